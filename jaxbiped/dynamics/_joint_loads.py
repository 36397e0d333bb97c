"""Loads of what acts at the joints of a mechanism, and the constraint torques of couplings."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._tree import Loads, Motion, plus, weighted
from jaxbiped.dynamics._tree_inertia import Elimination, substitute
from jaxbiped.linalg._elimination import Entry, inverse
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._joint_parts import Coupling, Latch, Spring, Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._structure import Angle, Structure

_ROOT_E = 1.6487212707001282
"""√e, which makes a latch's largest torque the one that it is told to have."""


def angle_value(angle: Angle, values: tuple[Scalar, ...], vertical: Scalar | None) -> Scalar:
    """A sum of angles, or of rates, for which `vertical` is None."""
    total: Entry = None
    for body, weight in angle.weights:
        total = plus(total, weighted(values[body], weight))
    if angle.vertical and vertical is not None:
        total = plus(total, weighted(vertical, angle.vertical))
    return jnp.zeros_like(values[0]) if total is None else total


class Pressed(NamedTuple):
    """How far [rad] and how fast [rad/s] one limit of a stop is passed, and its torque's sign."""

    penetration: Scalar
    rate: Scalar
    sign: float


def pressed_limits(stop: Stop, angle: Scalar, rate: Scalar) -> list[Pressed]:
    """Each limit of a stop."""
    found = []
    if stop.upper is not None:
        found.append(Pressed(angle - stop.upper, rate, -1.0))
    if stop.lower is not None:
        found.append(Pressed(stop.lower - angle, -rate, 1.0))
    return found


def _spring_torque(spring: Spring, angle: Scalar, rate: Scalar) -> Scalar:
    torque: Any = None
    if spring.stiffness is not None:
        stretched = angle if spring.rest is None else angle - spring.rest
        torque = -(spring.stiffness * stretched)
    if spring.damping is not None:
        torque = plus(torque, -(spring.damping * rate))
    return torque


def _stop_torque(stop: Stop, angle: Scalar, rate: Scalar) -> Scalar:
    assert stop.law is not None  # the scene has refused a stop without one
    torque: Any = None
    for limit in pressed_limits(stop, angle, rate):
        force = stop.law.force(limit.penetration, limit.rate)
        torque = plus(torque, weighted(force, limit.sign))
    return torque


def _latch_torque(latch: Latch, angle: Scalar, rate: Scalar) -> Scalar:
    u = (angle - latch.at) / latch.width
    pull = latch.torque * (_ROOT_E * u)
    if latch.damping is not None:
        pull = pull + latch.damping * rate
    return -(jnp.exp(-0.5 * u * u) * pull)


_TORQUES: dict[type, Callable[..., Scalar]] = {
    Spring: _spring_torque,
    Stop: _stop_torque,
    Latch: _latch_torque,
}


def with_joint_loads(
    loads: Loads, mechanism: Mechanism, motion: Motion, slope: Scalar | None
) -> Loads:
    """With the torques of springs, stops and latches.

    Args:
        loads: what acts besides.
        mechanism: whose joints they are.
        motion: angles and rates of all bodies.
        slope: angle of the vertical [rad]; None for stops and latches of rigid feet alone.
    """
    for angle, part in zip(mechanism.structure.joints, mechanism.joints, strict=True):
        if isinstance(part, Coupling):
            continue
        value = angle_value(angle, motion.angles, slope)
        rate = angle_value(angle, motion.rates, None)
        loads = loads.with_torques(angle.weights, _TORQUES[type(part)](part, value, rate))
    return loads


def motion_of(
    mechanism: Mechanism, ground: Ground, places: list[Scalar], rates: list[Scalar]
) -> Motion:
    """Angles and rates of all bodies from the coordinates of a state, those of the free ones.

    Args:
        mechanism: what moves.
        ground: whose slope the vertical follows.
        places: x and z of the root point, then free angles.
        rates: of these.
    """
    structure, joints = mechanism.structure, mechanism.joints
    n = len(structure.bodies)
    angles, turning = [places[0]] * n, [rates[0]] * n
    for j, angle, rate in zip(structure.free, places[2:], rates[2:], strict=True):
        angles[j], turning[j] = angle, rate
    for each in structure.fixed:
        own = angle_value(each.angle, tuple(angles), ground.slope)
        for k, weight in each.rests:
            rest = joints[k].rest  # type: ignore[attr-defined]
            own = own if rest is None else own + weighted(rest, weight)
        angles[each.body] = own
        turning[each.body] = angle_value(each.angle, tuple(turning), None)
    return Motion(places[0], places[1], rates[0], rates[1], tuple(angles), tuple(turning))


def with_constraint_torques(
    structure: Structure, joints: tuple[object, ...], factors: Elimination, loads: Loads
) -> list[Scalar]:
    """Accelerations in the falling frame under loads, couplings held by their torques."""
    free: list[Any] = substitute(structure, factors, loads)
    held = [
        angle
        for angle, part in zip(structure.joints, joints, strict=True)
        if isinstance(part, Coupling)
    ]
    if not held:
        return free
    like = free[0]
    answers = [
        substitute(
            structure,
            factors,
            Loads.none(structure).with_torques(angle.weights, jnp.ones_like(like)),
        )
        for angle in held
    ]

    def along(angle: Angle, accelerations: list[Scalar]) -> Scalar:
        return angle_value(angle, tuple(accelerations[2:]), None)

    mobility = inverse([[along(angle, answer) for answer in answers] for angle in held])
    gaps = [along(angle, free) for angle in held]
    for row, answer in zip(mobility, answers, strict=True):
        torque = sum(
            (-a * gap for a, gap in zip(row[1:], gaps[1:], strict=True)), -row[0] * gaps[0]
        )
        free = [plus(a, torque * b) for a, b in zip(free, answer, strict=True)]
    return free
