"""The state of the walker in minimal coordinates, and the seed's start."""

from typing import NamedTuple, TypeVar

import jax
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_finite, check_type
from jaxbiped._types import Scalar, as_float, by_numpy


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
