"""State of a walker with bristle friction."""

from typing import NamedTuple, TypeAlias

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar
from jaxbiped.dynamics._formulation import state_type
from jaxbiped.dynamics._state import State, check_state
from jaxbiped.scene._scene import Scene


class BristleState(NamedTuple):
    """A `State` with the bristles of both feet: ten scalar leaves.

    Attributes:
        hip_x, hip_z, theta_1, theta_2, hip_vx, hip_vz, omega_1, omega_2: as in `State`.
        bristle_1, bristle_2: see `AbstractBristleLaw` [–].
    """

    hip_x: Scalar
    hip_z: Scalar
    theta_1: Scalar
    theta_2: Scalar
    hip_vx: Scalar
    hip_vz: Scalar
    omega_1: Scalar
    omega_2: Scalar
    bristle_1: Scalar
    bristle_2: Scalar


MinimalState: TypeAlias = State | BristleState
"""A state in minimal coordinates of a walker with laws of contact."""


@state_type.register
def _(scene: Scene) -> type[MinimalState]:
    return BristleState if scene.has_bristles else State


def state_for(scene: Scene, state: PyTree, name: str = "state") -> MinimalState:
    """A checked start of the type that a scene needs: bristles are straight unless given.

    Raises:
        ArgumentError: not a state, bristles where the scene has none, an entry that is not finite,
            or leaves of different shapes.
    """
    kind = state_type(scene)
    if kind is BristleState and isinstance(state, State):
        state = check_state(state, State, name)
        straight = jnp.zeros_like(state.hip_x)
        return BristleState(**state._asdict(), bristle_1=straight, bristle_2=straight)
    if kind is State and isinstance(state, BristleState):
        raise ArgumentError(
            f"{name} has bristles, but friction = {type(scene.friction).__name__} has none: give a "
            "State."
        )
    return check_state(state, kind, name)
