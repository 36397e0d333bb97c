"""Loads of what acts at the joints of a mechanism, and the constraint torques of couplings."""

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._tree import Loads, Motion
from jaxbiped.dynamics._tree_inertia import Elimination, substitute
from jaxbiped.linalg._small_matrices import inverse
from jaxbiped.linalg._sparse_lu import plus
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._joint_parts import Coupling, Latch, Spring, Stop
from jaxbiped.scene._mechanism import Mechanism
from jaxbiped.scene._mechanism_pieces import with_fixed
from jaxbiped.scene._motor_motion import angle_value
from jaxbiped.scene._structure import Angle, Structure, weighted
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw

_ROOT_E = 1.6487212707001282
"""√e, the factor with which a latch's largest torque is its parameter `torque`."""


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


def _offset(latch: Latch, angle: Scalar) -> Scalar:
    """How many widths a latch's angle is from where it holds."""
    return (angle if latch.at is None else angle - latch.at) / latch.width


def _latch_torque(latch: Latch, angle: Scalar, rate: Scalar) -> Scalar:
    u = _offset(latch, angle)
    pull = latch.torque * (_ROOT_E * u)
    if latch.damping is not None:
        pull = pull + latch.damping * rate
    return -(jnp.exp(-0.5 * u * u) * pull)


_TORQUES: dict[type, Callable[..., Scalar]] = {
    Spring: _spring_torque,
    Stop: _stop_torque,
    Latch: _latch_torque,
}


def _moved_parts(
    mechanism: Mechanism, motion: Motion, slope: Scalar | None, *kinds: type
) -> Iterator[tuple[Angle, Any, Scalar, Scalar]]:
    """Gives the parts of these kinds with their angles, the values [rad] and rates [rad/s]."""
    for angle, part in zip(mechanism.structure.joints, mechanism.joints, strict=True):
        if type(part) in kinds:
            value = angle_value(angle, motion.angles, slope)
            yield angle, part, value, angle_value(angle, motion.rates, None)


def with_joint_loads(
    loads: Loads, mechanism: Mechanism, motion: Motion, slope: Scalar | None, *, stops: bool
) -> Loads:
    """With the torques of springs, stops and latches.

    `slope` [rad] is None for stops and latches of rigid feet alone. `stops` tells whether these are
    elastic; on rigid feet they are plastic.
    """
    kinds = (Spring, Stop, Latch) if stops else (Spring, Latch)
    for angle, part, value, rate in _moved_parts(mechanism, motion, slope, *kinds):
        loads = loads.with_torques(angle.weights, _TORQUES[type(part)](part, value, rate))
    return loads


def _spring_energy(spring: Spring, angle: Scalar) -> Scalar:
    if spring.stiffness is None:
        return jnp.zeros_like(angle)
    stretched = angle if spring.rest is None else angle - spring.rest
    return 0.5 * spring.stiffness * stretched * stretched


def _stop_energy(stop: Stop, angle: Scalar) -> Scalar:
    assert stop.law is not None
    stored = jnp.zeros_like(angle)
    for limit in pressed_limits(stop, angle, angle):
        depth = limit.penetration
        stored = stored + jnp.where(depth > 0.0, stop.law.elastic_energy(depth), 0.0)
    return stored


def _latch_energy(latch: Latch, angle: Scalar) -> Scalar:
    """Zero where it holds."""
    u = _offset(latch, angle)
    return latch.torque * latch.width * _ROOT_E * (1.0 - jnp.exp(-0.5 * u * u))


_ENERGIES: dict[type, Callable[..., Scalar]] = {
    Spring: _spring_energy,
    Stop: _stop_energy,
    Latch: _latch_energy,
}


class JointEnergy(NamedTuple):
    """What springs, stops and latches store [J], and their powers [W].

    Attributes:
        stored: all together.
        taken: power that the walker puts into them.
        lost: what of it is not stored.
    """

    stored: Scalar
    taken: Scalar
    lost: Scalar


def joint_energy(
    mechanism: Mechanism, motion: Motion, slope: Scalar, *, stops: bool
) -> JointEnergy | None:
    """Energy and powers of springs, stops and latches; None where there are none.

    `stops`: whether they are elastic.
    """
    total: Any = (None, None, None)
    kinds = (Spring, Stop, Latch) if stops else (Spring, Latch)
    for _, part, value, rate in _moved_parts(mechanism, motion, slope, *kinds):
        taken = -_TORQUES[type(part)](part, value, rate) * rate
        energy = functools.partial(_ENERGIES[type(part)], part)
        stored, kept = jax.jvp(energy, (value,), (rate,))
        total = tuple(map(plus, total, (stored, taken, taken - kept)))
    return None if total[0] is None else JointEnergy(*total)


def stop_limits(
    mechanism: Mechanism, motion: Motion, slope: Scalar
) -> tuple[tuple[AbstractNormalLaw, Pressed], ...]:
    """Every limit of every stop with its law."""
    found = []
    for _, part, value, rate in _moved_parts(mechanism, motion, slope, Stop):
        if part.law is not None:
            found += [(part.law, limit) for limit in pressed_limits(part, value, rate)]
    return tuple(found)


def of_all_bodies(
    structure: Structure, values: Sequence[Scalar], like: Scalar
) -> tuple[Scalar, ...]:
    """Rates or accelerations of all bodies' angles from those of the free ones, shaped `like`."""
    return tuple(with_fixed(structure, _by_body(structure, values, like)))


def _by_body(structure: Structure, values: Sequence[Scalar], like: Scalar) -> list[Scalar]:
    """Values of the free bodies by the numbers of all; `like` in place of the others."""
    found = [like] * len(structure.bodies)
    for j, value in zip(structure.free, values, strict=True):
        found[j] = value
    return found


def motion_of(
    mechanism: Mechanism, ground: Ground, places: list[Scalar], rates: list[Scalar]
) -> Motion:
    """Angles and rates of all bodies from the coordinates of a state and their rates.

    The coordinates are x and z of the root point, and then the free angles.
    """
    structure = mechanism.structure
    own = _by_body(structure, places[2:], places[0])
    angles = with_fixed(structure, own, ground.slope, mechanism.joints)
    turning = of_all_bodies(structure, rates[2:], rates[0])
    return Motion(places[0], places[1], rates[0], rates[1], tuple(angles), turning)


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
