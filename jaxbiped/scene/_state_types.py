"""Types of states in minimal coordinates, by the names of their scalars."""

import collections
import re
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias, TypeVar

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar, StateLeaf
from jaxbiped.caching._caches import bounded_cache

CLOCK = "clock"
"""Name of the scalar that is the time since the last strike [s], of scenes whose laws read it."""
STRIKE_LEG = "strike_leg"
"""Name of the scalar that tells on compliant feet which leg struck last: 0 for the one that stands
where a cycle begins, and so on in the order of the legs."""

SomeState = TypeVar("SomeState", bound=NamedTuple)
"""A state of any kind, which comes back as the same kind."""


class State(NamedTuple):
    """Hip position, leg angles and their rates: eight scalar leaves in the slope's frame.

    The frame is fixed to the slope: x along it, downhill positive; z along its outward normal. A
    leg's angle is measured from that normal, and is positive if its foot is ahead of (downhill
    from) the hip. Angles of a start are reduced to the range from −π to π. The leaves may have any
    common batch shape.

    Attributes:
        hip_x, hip_z: hip position [m].
        theta_1, theta_2: leg angles [rad].
        hip_vx, hip_vz: hip velocity [m/s].
        omega_1, omega_2: leg rates [rad/s].
    """

    hip_x: StateLeaf
    hip_z: StateLeaf
    theta_1: StateLeaf
    theta_2: StateLeaf
    hip_vx: StateLeaf
    hip_vz: StateLeaf
    omega_1: StateLeaf
    omega_2: StateLeaf


class BristleState(NamedTuple):
    """A `State` with the bristles of both feet: ten scalar leaves.

    Attributes:
        hip_x, hip_z, theta_1, theta_2, hip_vx, hip_vz, omega_1, omega_2: as in `State`.
        bristle_1, bristle_2: see `AbstractBristleLaw` [–].
    """

    hip_x: StateLeaf
    hip_z: StateLeaf
    theta_1: StateLeaf
    theta_2: StateLeaf
    hip_vx: StateLeaf
    hip_vz: StateLeaf
    omega_1: StateLeaf
    omega_2: StateLeaf
    bristle_1: StateLeaf
    bristle_2: StateLeaf


MinimalState: TypeAlias = State | BristleState
"""A state in minimal coordinates of a walker with laws of contact."""


class Accelerations(NamedTuple):
    """Second derivatives of the coordinates, leaves shaped as the state's.

    Attributes:
        hip_ax, hip_az: acceleration of the hip in the slope's frame [m/s²].
        alpha_1, alpha_2: angular accelerations of the legs [rad/s²].
    """

    hip_ax: Scalar
    hip_az: Scalar
    alpha_1: Scalar
    alpha_2: Scalar


class RigidState(NamedTuple):
    """Place and leg angles of a walker that rolls on leg 2; five scalar leaves.

    The frame and the angles are those of `State`. The hip's height and velocity follow from the
    stance leg. Leaves may carry any common batch shape.

    Attributes:
        hip_x: hip position along the slope [m].
        theta_1, theta_2: angles of swing leg and stance leg [rad].
        omega_1, omega_2: rates of these angles [rad/s].
    """

    hip_x: StateLeaf
    theta_1: StateLeaf
    theta_2: StateLeaf
    omega_1: StateLeaf
    omega_2: StateLeaf


class RedundantState(NamedTuple):
    """Centre of mass and angle of each leg, and their rates: twelve scalar leaves.

    The frame is that of `State`. If the hip has a mass, half of it belongs to each leg, and the
    centre of mass is that of the leg with this half.

    Attributes:
        x_1, z_1, x_2, z_2: centres of mass [m].
        theta_1, theta_2: leg angles [rad].
        vx_1, vz_1, vx_2, vz_2: velocities [m/s].
        omega_1, omega_2: leg rates [rad/s].
    """

    x_1: StateLeaf
    z_1: StateLeaf
    theta_1: StateLeaf
    x_2: StateLeaf
    z_2: StateLeaf
    theta_2: StateLeaf
    vx_1: StateLeaf
    vz_1: StateLeaf
    omega_1: StateLeaf
    vx_2: StateLeaf
    vz_2: StateLeaf
    omega_2: StateLeaf


class EulerState(NamedTuple):
    """A `RedundantState` with the planar Euler parameters of each leg: sixteen scalar leaves.

    Attributes:
        x_1, z_1, x_2, z_2: centres of mass [m].
        cos_half_1, sin_half_1, cos_half_2, sin_half_2: cos θ/2 and sin θ/2 of each leg [–].
        vx_1, vz_1, vx_2, vz_2: velocities [m/s].
        cos_rate_1, sin_rate_1, cos_rate_2, sin_rate_2: rates of the Euler parameters [1/s].
    """

    x_1: StateLeaf
    z_1: StateLeaf
    cos_half_1: StateLeaf
    sin_half_1: StateLeaf
    x_2: StateLeaf
    z_2: StateLeaf
    cos_half_2: StateLeaf
    sin_half_2: StateLeaf
    vx_1: StateLeaf
    vz_1: StateLeaf
    cos_rate_1: StateLeaf
    sin_rate_1: StateLeaf
    vx_2: StateLeaf
    vz_2: StateLeaf
    cos_rate_2: StateLeaf
    sin_rate_2: StateLeaf


class RollingMotion(NamedTuple):
    """Accelerations in single support.

    Attributes:
        alpha_1, alpha_2: angular accelerations of swing leg and stance leg [rad/s²].
        force: force of the ground that keeps the stance foot rolling, a `FootForce` [N]. If it
            would have to pull, the foot has left the ground.
    """

    alpha_1: Scalar
    alpha_2: Scalar
    force: Any


WalkerState: TypeAlias = MinimalState | RigidState
"""A state of a walker in minimal coordinates, compliant or rigid."""


_NAMED = (
    State,
    BristleState,
    RigidState,
    RedundantState,
    EulerState,
    Accelerations,
    RollingMotion,
)
_KEPT = 64
"""Types that are kept though no state of theirs is left."""
_CALLED = re.compile(r"StateOf\((\w+(?:,\w+)*)\)")


def state_type_of(names: Sequence[str]) -> type[Any]:
    """The NamedTuple of scalars with these names; `State` or another known one where they agree.

    It pickles, and its name tells it from others, so that programs on disk are found again by it.
    """
    return _made(tuple(names))


@bounded_cache(_KEPT)
def _made(names: tuple[str, ...]) -> type[Any]:
    for kind in _NAMED:
        if kind._fields == names:
            return kind
    made: Any = collections.namedtuple("State", names)  # type: ignore[misc]
    made.__module__, made.__qualname__ = __name__, f"StateOf({','.join(names)})"
    return made


def scalars_named(state: Any, names: Sequence[str]) -> tuple[Any, ...]:
    """Gives the scalars of a state that have these names.

    Raises:
        ArgumentError: the state is another scene's, and does not have one of them.
    """
    for name in names:
        if not hasattr(state, name):
            raise ArgumentError(
                f"state has no {name}, which the scene's walker has: give a state of this scene."
            )
    return tuple(getattr(state, name) for name in names)


def check_scalars(state: Any, names: Sequence[str]) -> None:
    """Raises `ArgumentError` unless a state has just these scalars, in this order."""
    scalars_named(state, names)
    if state._fields != tuple(names):
        raise ArgumentError(
            f"state has the scalars {', '.join(state._fields)}, which is not allowed: those of "
            f"this scene are {', '.join(names)}."
        )


def is_redundant(state: Any) -> bool:
    """Whether a state of a walker, or a kind of state, has coordinates of each body.

    The first of them are a body's place, where else the place of the root point is.
    """
    first, second = (*getattr(state, "_fields", ()), "", "")[:2]
    return first.startswith("x_") and second == f"z_{first.removeprefix('x_')}"


def __getattr__(name: str) -> Any:
    """A type by its name, for pickles."""
    called = _CALLED.fullmatch(name)
    if called is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return state_type_of(called[1].split(","))
