"""Contact forces: those of the ground on both feet, and the loads that actuators see."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.dynamics._actuation import load_shares
from jaxbiped.dynamics._feet import Feet, Foot, feet, touches
from jaxbiped.dynamics._redundant_state import CompliantState
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene.actuation._abstract_actuator import HipMotion
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw
from jaxbiped.scene.laws.friction._coulomb import Frictionless


class FootForce(NamedTuple):
    """Force of the ground on one foot.

    Attributes:
        normal: F_N along the slope's outward normal [N], never negative.
        tangential: along the slope, downhill positive [N]; None where the scene has no friction.
    """

    normal: Scalar
    tangential: Scalar | None


def foot_force(scene: CompliantScene, foot: Foot) -> FootForce:
    """Force on a foot whose kinematics are known."""
    if foot.admitted is False:
        nothing = jnp.zeros_like(foot.penetration)
        return FootForce(nothing, None if isinstance(scene.friction, Frictionless) else nothing)
    normal = scene.normal.force(foot.penetration, foot.penetration_rate)
    if foot.admitted is not None:
        normal = jnp.where(foot.admitted, normal, 0.0)
    if isinstance(scene.friction, Frictionless):
        return FootForce(normal, None)
    if isinstance(scene.friction, AbstractBristleLaw):
        if foot.bristle is None:
            raise ArgumentError(
                f"state has no bristles, which friction = {type(scene.friction).__name__} needs: "
                "give a BristleState."
            )
        return FootForce(normal, scene.friction.force(normal, foot.slip_speed, foot.bristle))
    return FootForce(normal, scene.friction.force(normal, foot.slip_speed))


class FootForces(NamedTuple):
    """Forces of the ground on both feet.

    Attributes:
        foot_1, foot_2: on each leg's foot, leaves shaped as the state's [N].
    """

    foot_1: FootForce
    foot_2: FootForce


@kept_alone
def foot_forces(scene: CompliantScene, state: CompliantState) -> FootForces:
    """Forces on both feet at a state; leaves shaped as the state's.

    Args:
        scene: the walker, in minimal or redundant coordinates.
        state: leaves of any common shape, SI units.

    Returns:
        Normal and tangential force on each foot [N], leaves shaped as the state's.

    Raises:
        ArgumentError: a state without the bristles that the scene's friction needs.
    """
    both = feet(scene, state)
    return FootForces(foot_force(scene, both.foot_1), foot_force(scene, both.foot_2))


class Contacts(NamedTuple):
    """Feet, whether each touches, and the forces on them; leaves shaped as the state's."""

    feet: Feet
    touching: tuple[Scalar, Scalar]
    forces: FootForces

    @property
    def both_carry(self) -> Scalar:
        """Whether both feet carry something (boolean): double support."""
        return (self.forces.foot_1.normal > 0.0) & (self.forces.foot_2.normal > 0.0)


def contacts(scene: CompliantScene, state: CompliantState) -> Contacts:
    """Both feet's contacts with the ground."""
    both = feet(scene, state)
    first, second = (jnp.broadcast_to(touches(foot), foot.x.shape) for foot in both)
    return Contacts(both, (first, second), foot_forces(scene, state))


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
