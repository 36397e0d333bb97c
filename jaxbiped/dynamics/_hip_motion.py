"""Motion at the hip, as actuators see it: angles, rates and loads of both legs."""

from jaxbiped._types import Scalar
from jaxbiped.dynamics._actuation import load_shares
from jaxbiped.dynamics._feet import Feet, Foot
from jaxbiped.dynamics._forces import foot_force
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene.actuation._abstract_actuator import HipMotion


def normal_forces(scene: CompliantScene, both: Feet) -> tuple[Scalar | None, Scalar | None]:
    """Normal force on each foot [N]; None for one that is known never to touch."""

    def force(foot: Foot) -> Scalar | None:
        return None if foot.admitted is False else foot_force(scene, foot).normal

    return force(both.foot_1), force(both.foot_2)


def hip_motion(
    scene: CompliantScene,
    both: Feet,
    angle: tuple[Scalar, Scalar],
    rate: tuple[Scalar, Scalar],
) -> HipMotion:
    """What actuators at the hip of a compliant walker know of it."""
    return HipMotion(angle, rate, load_shares(scene, normal_forces(scene, both)))
