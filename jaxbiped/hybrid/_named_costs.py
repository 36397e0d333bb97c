"""Named costs of driven walkers: squares of torques, absolute work, peaks, ranges of joints."""

import functools
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._quantity import Quantity
from jaxbiped._types import Scalar
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.dynamics._energy import is_driven
from jaxbiped.dynamics._surfaces import clearance_rate
from jaxbiped.dynamics._walker_motion import Drive, WalkerMotion
from jaxbiped.hybrid._motion_costs import Cost, Extreme, Integral
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene.actuation._actuators import PushOff

_PARTS = 64
"""Parts of which a cost is kept: it is the same object each time, or all would compile again."""


class NamedCost(NamedTuple):
    """A cost by name: a sum of costs of a part of the walker, or of the whole walker.

    Attributes:
        quantity: words, symbol and unit.
        costs: the costs of the part of a name, None for all, with their weights in the sum.
        part: what has such a cost by itself, as `NAME[part]`: "motor" or "angle"; empty for
            nothing.
        lacks: why a scene does not have the cost, or None if it has.
    """

    quantity: Quantity
    costs: Callable[[str | None], tuple[tuple[float, Cost], ...]]
    part: str
    lacks: Callable[[Any], str | None]


def _torques(part: str | None, motion: WalkerMotion) -> list[Drive]:
    if part is not None:
        return list(motion.motor(part))
    return [torque for torques in motion.motors().values() for torque in torques]


def _sum(part: str | None, of: Callable[[Drive], Scalar], motion: WalkerMotion) -> Scalar:
    first, *others = map(of, _torques(part, motion))
    return sum(others, first)


def _largest(part: str | None, of: Callable[[Drive], Scalar], motion: WalkerMotion) -> Scalar:
    return functools.reduce(jnp.maximum, map(of, _torques(part, motion)))


def _square(torque: Drive) -> Scalar:
    return torque.torque * torque.torque


def _absolute_power(torque: Drive) -> Scalar:
    return jnp.abs(torque.power)


def _absolute_torque(torque: Drive) -> Scalar:
    return jnp.abs(torque.torque)


def _powers(part: str | None, motion: WalkerMotion) -> list[Scalar]:
    return [torque.power for torque in _torques(part, motion)]


def _nothing(motion: WalkerMotion) -> Scalar:
    return jnp.zeros_like(motion.state[0])


def _half_square_of_push_off(motion: WalkerMotion) -> Scalar:
    impulse = motion.push_off()
    return 0.5 * impulse * impulse


def _square_of_jerk(motion: WalkerMotion) -> Scalar:
    """The sum of squares of the time derivatives of all angular accelerations [rad²/s⁶]."""
    system, scene = system_of(motion.scene), motion.scene
    accelerations = [name for name in motion.state._fields if name.startswith("omega_")]

    def rates(state: Any) -> Any:
        return system.vector_field(jnp.zeros(()), state, scene)

    velocity = rates(motion.state)
    _, change = jax.jvp(rates, (motion.state,), (velocity,))
    first, *others = (getattr(change, name) ** 2 for name in accelerations)
    return sum(others, first)


def _value_of_angle(part: str | None, motion: WalkerMotion) -> Scalar:
    return motion.angle(part)


@bounded_cache(_PARTS)
def _torque_squared(part: str | None) -> tuple[tuple[float, Cost], ...]:
    rate = functools.partial(_sum, part, _square)
    return ((1.0, Integral(rate, Quantity("torque squared", r"$\int u^2$", "N^2 m^2 s"))),)


@bounded_cache(_PARTS)
def _absolute_work(part: str | None) -> tuple[tuple[float, Cost], ...]:
    rate = functools.partial(_sum, part, _absolute_power)
    quantity = Quantity("absolute work", "$W_a$", "J")
    return ((1.0, Integral(rate, quantity, corners=functools.partial(_powers, part))),)


@bounded_cache(_PARTS)
def _push_off_squared(part: str | None) -> tuple[tuple[float, Cost], ...]:
    quantity = Quantity("push off squared", r"$\frac{1}{2} P^2$", "N^2 s^2")
    return ((1.0, Integral(_nothing, quantity, at_strike=_half_square_of_push_off)),)


def _landing_speed_of(motion: WalkerMotion) -> Scalar:
    return -clearance_rate(motion.scene, motion.state)


@bounded_cache(_PARTS)
def _landing_speed(part: str | None) -> tuple[tuple[float, Cost], ...]:
    quantity = Quantity("landing speed", "$v_n$", "m/s")
    return ((1.0, Integral(_nothing, quantity, at_strike=_landing_speed_of)),)


@bounded_cache(_PARTS)
def _jerk(part: str | None) -> tuple[tuple[float, Cost], ...]:
    return ((1.0, Integral(_square_of_jerk, Quantity("jerk", "$j$", "rad^2/s^5"))),)


@bounded_cache(_PARTS)
def _peak_torque(part: str | None) -> tuple[tuple[float, Cost], ...]:
    value = functools.partial(_largest, part, _absolute_torque)
    return ((1.0, Extreme(value, Quantity("peak torque", "$u$", "N m"))),)


@bounded_cache(_PARTS)
def _peak_power(part: str | None) -> tuple[tuple[float, Cost], ...]:
    value = functools.partial(_largest, part, _absolute_power)
    return ((1.0, Extreme(value, Quantity("peak power", "$P$", "W"))),)


@bounded_cache(_PARTS)
def _joint_range(part: str | None) -> tuple[tuple[float, Cost], ...]:
    value, quantity = functools.partial(_value_of_angle, part), Quantity("angle", "", "rad")
    return (1.0, Extreme(value, quantity)), (-1.0, Extreme(value, quantity, smallest=True))


def _of_motors(scene: Any) -> str | None:
    return None if is_driven(scene) else "it has no motors"


def _of_push_off(scene: Any) -> str | None:
    parts = getattr(scene, "actuation", None) or ()
    return None if any(isinstance(part, PushOff) for part in parts) else "it has no push-off"


def _of_strikes(scene: Any) -> str | None:
    return "its feet are compliant" if scene.compliant else None


def _of_all(scene: Any) -> str | None:
    return None


NAMED_COSTS = {
    "torque_squared": NamedCost(
        Quantity("integral of the squared torques", r"$\int u^2$", "N^2 m^2 s"),
        _torque_squared,
        "motor",
        _of_motors,
    ),
    "absolute_work": NamedCost(
        Quantity("absolute work of the motors", "$W_a$", "J"), _absolute_work, "motor", _of_motors
    ),
    "push_off_squared": NamedCost(
        Quantity("half of the squared push-off", r"$\frac{1}{2} P^2$", "N^2 s^2"),
        _push_off_squared,
        "",
        _of_push_off,
    ),
    "landing_speed": NamedCost(
        Quantity("speed at which the feet come down", "$v_n$", "m/s"),
        _landing_speed,
        "",
        _of_strikes,
    ),
    "jerk": NamedCost(
        Quantity("integral of the squared angular jerk", "$j$", "rad^2/s^5"), _jerk, "", _of_all
    ),
    "peak_torque": NamedCost(
        Quantity("largest torque of a motor", "$u$", "N m"), _peak_torque, "motor", _of_motors
    ),
    "peak_power": NamedCost(
        Quantity("largest power of a motor", "$P$", "W"), _peak_power, "motor", _of_motors
    ),
    "joint_range": NamedCost(
        Quantity("range of an angle", r"$\Delta\varphi$", "rad"), _joint_range, "angle", _of_all
    ),
}
"""By name; `NAME[part]` is that of one motor, or of one angle.

- torque squared: Σ ∫ u² over all torques of motors, see `WalkerMotion.motors`.
- absolute work: Σ ∫ of the size of u φ̇, work of braking too.
- push off squared: ½ P² of each push-off's impulse P.
- landing speed: of the swing foot towards the ground just before the strike; a sum over the strikes
  of a cycle. On rigid feet alone. A gait has a positive one.
- jerk: Σ ∫ (dα/dt)² over the angular accelerations of all free angles.
- peak torque, peak power: the largest size of u and of u φ̇ of any motor along the cycle.
- joint range: largest minus smallest value of an angle, `joint_range[knee_1]`.
"""

_OF_PART = re.compile(r"(\w+)\[(\w+)\]")


def part_of(name: str) -> tuple[str, str | None]:
    """The name of a cost and its part; None where it is one of the whole walker."""
    match = _OF_PART.fullmatch(name)
    return (match[1], match[2]) if match else (name, None)


def cost_named(name: str, what: str, others: tuple[str, ...] = ()) -> tuple[NamedCost, str | None]:
    """A cost by its name, or of a part as `NAME[part]`, and this part.

    Raises:
        ArgumentError: an unknown name, which `what` asks for; `others` are known besides.
    """
    base, part = part_of(name)
    if base not in NAMED_COSTS or (part is not None and not NAMED_COSTS[base].part):
        check_choice(what, name, (*others, *NAMED_COSTS))
    cost = NAMED_COSTS[base]
    if part is None and cost.part == "angle":
        raise ArgumentError(f"{what} = {name!r} is not allowed: name an angle, {name}[BODY].")
    return cost, part
