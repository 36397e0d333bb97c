"""Forces of the ground on the feet, compliant or rigid."""

import functools
from typing import Any, cast

import jax.numpy as jnp

from jaxbiped._checks import check_type
from jaxbiped._types import Scalar
from jaxbiped.compiler import kept_alone
from jaxbiped.dynamics._contacts import FootForce, feet, foot_force
from jaxbiped.dynamics._mode_changes import foot_loads
from jaxbiped.dynamics._stance import Stance, of_stance
from jaxbiped.dynamics._stance_motion import ground_force, turning_of
from jaxbiped.scene._scene import AbstractWalkerScene, CompliantScene, RigidScene
from jaxbiped.scene._state_types import check_scalars


@kept_alone
def foot_forces(scene: AbstractWalkerScene, state: Any) -> tuple[FootForce, ...]:
    """Forces on all feet at a state; leaves shaped as the state's.

    Args:
        scene: the walker: compliant, in minimal or redundant coordinates, or rigid.
        state: leaves of any common shape, SI units.

    Returns:
        Normal and tangential force on each foot [N], leaves shaped as the state's. Of a rigid
        walker, those of constraint: zero on a foot that does not stand, and a normal force below
        zero where the ground would have to pull. If heel and toe of a foot stand, the tangential
        force is that of the first.

    Raises:
        ArgumentError: the state is another scene's, or lacks the bristles that the scene's friction
            needs.
    """
    check_type("scene", scene, AbstractWalkerScene)
    if isinstance(scene, RigidScene):
        check_scalars(state, scene.state_names)
        return of_stance(scene, state, functools.partial(_forces_of_stance, scene))
    walker = cast("CompliantScene", scene)
    return tuple(foot_force(walker, foot) for foot in feet(walker, state))


def _forces_of_stance(scene: RigidScene, stance: Stance) -> tuple[FootForce, ...]:
    turning = turning_of(scene, stance)
    force = ground_force(scene, stance, turning.free)
    normal, tangential = force.normal, jnp.asarray(force.tangential)
    nothing = jnp.zeros_like(normal)
    by_foot: list[tuple[Scalar, Scalar]] = [(normal, tangential)]
    if stance.stands:
        first, second = stance.stands
        loads = foot_loads(scene, stance, turning)
        by_foot = [
            (jnp.where(first & second, load, jnp.where(stands, normal, 0.0)), along)
            for load, stands, along in (
                (loads[0], first, jnp.where(first, tangential, 0.0)),
                (loads[1], second, jnp.where(first, 0.0, tangential)),
            )
        ]
    forces = [FootForce(nothing, nothing)] * len(scene.mechanism.feet)
    for k, (down, along) in zip(stance.feet, by_foot, strict=True):
        forces[k] = FootForce(down, along)
    return tuple(forces)
