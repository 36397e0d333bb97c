"""States of the walker in minimal coordinates: compliant, with bristles, rigid; the seed's start.

A formulation registers its kind of scene here, by `state_type` and `field_of`.
"""

import functools
from typing import NamedTuple, TypeAlias, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_finite, check_type
from jaxbiped._types import Scalar, VectorField, as_float, by_numpy
from jaxbiped.caching._cached_jit import kept_alone
from jaxbiped.scene._scene import AbstractWalkerScene, RigidScene, Scene


@functools.singledispatch
def state_type(scene: object) -> type[PyTree]:
    """The type of a scene's states, a NamedTuple of scalar leaves."""
    raise TypeError(f"{type(scene).__name__} has no formulation.")


@functools.singledispatch
def field_of(scene: object) -> VectorField:
    """A scene's vector field f(t, state, scene), in the form that `diffrax.ODETerm` takes."""
    raise TypeError(f"{type(scene).__name__} has no formulation.")


class State(NamedTuple):
    """Hip position, leg angles and their rates: eight scalar leaves in the slope's frame.

    The frame is fixed to the slope: x along it, downhill positive; z along its outward normal. A
    leg's angle is measured from that normal, positive when its foot is ahead of (downhill from)
    the hip. A start whose angles are a whole turn more is the same start, and begins between −π
    and π. Leaves may carry any common batch shape.

    Attributes:
        hip_x, hip_z: hip position [m].
        theta_1, theta_2: leg angles [rad].
        hip_vx, hip_vz: hip velocity [m/s].
        omega_1, omega_2: leg rates [rad/s].
    """

    hip_x: Scalar
    hip_z: Scalar
    theta_1: Scalar
    theta_2: Scalar
    hip_vx: Scalar
    hip_vz: Scalar
    omega_1: Scalar
    omega_2: Scalar


def seed_state() -> State:
    """The seed paper's start (section 2.3) on a slope of 0.02 rad, its misprints mended.

    Leg 2 stands, leg 1 swings and is momentarily all but at rest. The paper prints the legs'
    velocities with the labels swapped and one sign flipped; undoing that gives one hip velocity
    from both legs, to 1e-5 m/s.

    Returns:
        Scalar leaves, 64-bit floats.
    """
    return State(
        hip_x=as_float(0.0),
        hip_z=as_float(0.395),
        theta_1=as_float(-0.2479),
        theta_2=as_float(0.1655),
        hip_vx=as_float(0.49797),
        hip_vz=as_float(0.05853),
        omega_1=as_float(-0.0052),
        omega_2=as_float(-1.2565),
    )


_ANGLES = ("theta_1", "theta_2")


def within_a_turn(angle: Scalar) -> Scalar:
    """An angle [rad] without whole turns, between −π and π: the same start."""
    known = not isinstance(angle, jax.core.Tracer)
    if known and not np.any(np.abs(np.asarray(angle)) > np.pi):
        return angle
    turn = 2.0 * np.pi
    wrapped: Scalar = by_numpy(lambda numpy, x: x - turn * numpy.round(x / turn), angle)
    return wrapped


SomeState = TypeVar("SomeState", bound=NamedTuple)
"""A state of any kind, which comes back as the same kind."""


def exchange_legs(state: SomeState) -> SomeState:
    """The same motion with the names of the two legs exchanged; of a state of any kind.

    Args:
        state: leaves of any common shape.

    Returns:
        A state of the same kind.
    """
    swapped = {}
    for name in state._fields:
        twin = name[:-1] + {"1": "2", "2": "1"}.get(name[-1], name[-1])
        swapped[name] = getattr(state, twin)
    return state._replace(**swapped)


def check_state(state: PyTree, kind: type = State, name: str = "state") -> PyTree:
    """`state` with every leaf a floating-point array of one shape, angles without whole turns.

    Raises:
        ArgumentError: not a `kind`, an entry that is not finite, or leaves of different shapes.
    """
    check_type(name, state, kind)
    return check_leaves(state, name)


def check_leaves(state: SomeState, name: str) -> SomeState:
    """`state` with every leaf a floating-point array of one shape, angles without whole turns.

    None stays where a kind of state has it.

    Raises:
        ArgumentError: an entry that is not finite, or leaves of different shapes.
    """
    left_out = [name for name, default in state._field_defaults.items() if default is None]
    given = {
        field: value
        for field, value in state._asdict().items()
        if value is not None or field not in left_out
    }
    traced = [field for field, value in given.items() if isinstance(value, jax.core.Tracer)]
    for field, value in given.items():
        if field not in traced:
            check_finite(f"{name}.{field}", value)
    leaves = {field: as_float(value) for field, value in given.items()}
    leaves |= {name: within_a_turn(leaf) for name, leaf in leaves.items() if name in _ANGLES}
    shapes = {leaf.shape for leaf in leaves.values()}
    if len(shapes) > 1:
        raise ArgumentError(
            f"{name} has leaves of shapes {sorted(shapes)}: all of them must have the same shape."
        )
    if traced:  # together, for each operation on what is traced takes long
        check_finite(name, sum(leaves[field] for field in traced))
    return state._replace(**leaves)


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


def state_for(scene: AbstractWalkerScene, state: PyTree, name: str = "state") -> PyTree:
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
        law = type(cast(Scene, scene).friction).__name__
        raise ArgumentError(f"{name} has bristles, but friction = {law} has none: give a State.")
    return check_state(state, kind, name)


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
def whole_state(scene: AbstractWalkerScene, state: RigidState) -> State:
    """The same motion in the compliant walker's coordinates, its stance foot just touching.

    Args:
        scene: the walker, of any kind.
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
