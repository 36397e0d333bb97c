"""Forces of the ground on the feet."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._cached_jit import kept_alone
from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.dynamics._feet import Foot, feet
from jaxbiped.dynamics._redundant_state import CompliantState
from jaxbiped.scene._scene import CompliantScene
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
