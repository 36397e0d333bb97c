"""The state of the rigid walker, and the whole motion that it stands for."""

from typing import NamedTuple, TypeAlias

import jax.numpy as jnp

from jaxbiped._cached_jit import kept_alone
from jaxbiped._types import Scalar
from jaxbiped.dynamics._bristle_state import MinimalState
from jaxbiped.dynamics._formulation import state_type
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import RigidScene


class RigidState(NamedTuple):
    """Place and leg angles of a walker that rolls on leg 2; five scalar leaves.

    The frame and the angles are those of `State`. The hip's height and velocity follow from the
    stance leg. Leaves may carry any common batch shape.

    Attributes:
        hip_x: hip position along the slope [m].
        theta_1, theta_2: angles of swing leg and stance leg [rad].
        omega_1, omega_2: their rates [rad/s].
    """

    hip_x: Scalar
    theta_1: Scalar
    theta_2: Scalar
    omega_1: Scalar
    omega_2: Scalar


WalkerState: TypeAlias = MinimalState | RigidState
"""A state of a walker in minimal coordinates, compliant or rigid."""


@state_type.register
def _(scene: RigidScene) -> type[RigidState]:
    return RigidState


@kept_alone
def whole_state(scene: RigidScene, state: RigidState) -> State:
    """The same motion in the compliant walker's coordinates, its stance foot just touching.

    Args:
        scene: the rigid walker.
        state: leaves of any common shape, SI units.

    Returns:
        A `State`, leaves shaped as the state's.
    """
    walker = scene.walker
    sine, cosine = jnp.sin(state.theta_2), jnp.cos(state.theta_2)
    return State(
        hip_x=state.hip_x,
        hip_z=walker.r + walker.hip_to_foot * cosine,
        theta_1=state.theta_1,
        theta_2=state.theta_2,
        hip_vx=-(walker.r + walker.hip_to_foot * cosine) * state.omega_2,
        hip_vz=-walker.hip_to_foot * sine * state.omega_2,
        omega_1=state.omega_1,
        omega_2=state.omega_2,
    )


def rigid_state(state: State) -> RigidState:
    """The part of a compliant walker's state that the rigid one keeps, leg 2 standing.

    Args:
        state: leg 2 standing, leaves of any common shape, SI units.

    Returns:
        Hip place, angles and rates, leaves shaped as the state's.
    """
    return RigidState(state.hip_x, state.theta_1, state.theta_2, state.omega_1, state.omega_2)
