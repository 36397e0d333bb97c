"""Named costs of a motion: squares of torques, work, losses, slip, peaks, ranges, clearance."""

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
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._energy import energies, is_driven, powers
from jaxbiped.dynamics._footfalls import touches
from jaxbiped.dynamics._impact import push_off_work
from jaxbiped.dynamics._surfaces import clearance_rate
from jaxbiped.dynamics._walker_motion import Drive, WalkerMotion
from jaxbiped.hybrid._guards import Switch
from jaxbiped.hybrid._motion_costs import Cost, Extreme, Integral
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene.actuation._actuators import PushOff
from jaxbiped.scene.laws.friction._coulomb import Frictionless

_PARTS = 64
"""Parts of which a cost is kept: it is the same object each time, or all would compile again."""


class NamedCost(NamedTuple):
    """A cost by name: a sum of costs of a part of the walker, or of the whole walker.

    Attributes:
        quantity: words, symbol and unit.
        terms: the costs that are summed, with their weights, from the quantity and the part of a
            name, None for all.
        part: what has such a cost by itself, as `NAME[part]`: "motor" or "angle"; empty for
            nothing.
        lacks: why a scene does not have the cost, or None if it has.
    """

    quantity: Quantity
    terms: Callable[[Quantity, str | None], tuple[tuple[float, Cost], ...]]
    part: str
    lacks: Callable[[Any], str | None]

    def costs(self, part: str | None) -> tuple[tuple[float, Cost], ...]:
        """The costs of the part of a name, None for all, with their weights in the sum."""
        return _costs_of_part(self, part)


@bounded_cache(_PARTS)
def _costs_of_part(cost: NamedCost, part: str | None) -> tuple[tuple[float, Cost], ...]:
    return cost.terms(cost.quantity, part)


def _integral(rate: Callable[..., Scalar], **others: Any) -> Any:
    """Terms of a cost that is the integral of `rate(part, motion)`."""

    def terms(quantity: Quantity, part: str | None) -> tuple[tuple[float, Cost], ...]:
        corners = others.get("corners")
        own = others | {"corners": corners and functools.partial(corners, part)}
        return ((1.0, Integral(functools.partial(rate, part), quantity, **own)),)

    return terms


def _extremes(value: Callable[..., Scalar], *weights: float) -> Any:
    """Terms of extremes of `value(part, motion)`: of the largest, and of the smallest one."""

    def terms(quantity: Quantity, part: str | None) -> tuple[tuple[float, Cost], ...]:
        of_part = functools.partial(value, part)
        both = zip(weights, (False, True), strict=False)
        return tuple((weight, Extreme(of_part, quantity, low)) for weight, low in both if weight)

    return terms


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


def _largest_torque(part: str | None, motion: WalkerMotion) -> Scalar:
    return _largest(part, _absolute_torque, motion)


def _largest_power(part: str | None, motion: WalkerMotion) -> Scalar:
    return _largest(part, _absolute_power, motion)


def _squares_of_torques(part: str | None, motion: WalkerMotion) -> Scalar:
    return _sum(part, _square, motion)


def _absolute_powers(part: str | None, motion: WalkerMotion) -> Scalar:
    return _sum(part, _absolute_power, motion)


def _nothing(_: str | None, motion: WalkerMotion) -> Scalar:
    return jnp.zeros_like(motion.state[0])


def _half_square_of_push_off(motion: WalkerMotion) -> Scalar:
    impulse = motion.push_off()
    return 0.5 * impulse * impulse


def _square_of_jerk(_: str | None, motion: WalkerMotion) -> Scalar:
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


def _driving_power(_: str | None, motion: WalkerMotion) -> Scalar:
    """Power of the motors that drive, added up [W]: none gains energy by braking."""
    power = jnp.zeros_like(motion.state[0])
    for motor in _motor_powers(None, motion):
        power = power + jnp.maximum(motor, 0.0)
    return power


def _motor_powers(_: str | None, motion: WalkerMotion) -> tuple[Scalar, ...]:
    return powers(motion.scene, motion.state).motors or ()


def _driving_push_off(motion: WalkerMotion) -> Scalar:
    return jnp.maximum(_push_off_work(motion), 0.0)


def _power_of_impacts(_: str | None, motion: WalkerMotion) -> Scalar:
    return powers(motion.scene, motion.state).indentation


def _landing_speed(motion: WalkerMotion) -> Scalar:
    return -clearance_rate(motion.scene, motion.state)


def _kinetic_energy(motion: WalkerMotion) -> Scalar:
    return energies(motion.scene, motion.state).kinetic


def _lost_at_reset(before: WalkerMotion, after: WalkerMotion) -> Scalar:
    return _kinetic_energy(before) - _kinetic_energy(after)


def _push_off_work(motion: WalkerMotion) -> Scalar:
    return push_off_work(motion.scene, motion.state)


def _power_of_friction(_: str | None, motion: WalkerMotion) -> Scalar:
    return powers(motion.scene, motion.state).friction


def _slip_speed(_: str | None, motion: WalkerMotion) -> Scalar:
    slip = jnp.zeros_like(motion.state[0])
    for foot in feet(motion.scene, motion.state):
        slip = slip + jnp.where(touches(foot), jnp.abs(foot.slip_speed), 0.0)
    return slip


def _corners_of_slip(_: str | None, motion: WalkerMotion) -> list[Switch]:
    """Touchdown, where the rate of slip jumps, and changes of its sign."""
    corners = []
    for foot in feet(motion.scene, motion.state):
        admitted = True if foot.admitted is None else foot.admitted
        corners.append(Switch(foot.penetration, admitted, force_jumps=True))
        corners.append(Switch(foot.slip_speed, touches(foot)))
    return corners


def _clearance(_: str | None, motion: WalkerMotion) -> Scalar:
    return motion.clearance()


def _of_motors(scene: Any) -> str | None:
    return None if is_driven(scene) else "it has no motors"


def _of_push_off(scene: Any) -> str | None:
    parts = getattr(scene, "actuation", None) or ()
    return None if any(isinstance(part, PushOff) for part in parts) else "it has no push-off"


def _of_strikes(scene: Any) -> str | None:
    return "its feet are compliant" if scene.compliant else None


def _of_all(scene: Any) -> str | None:
    return None


def _of_slip(scene: Any) -> str | None:
    return None if hasattr(scene, "friction") else "a rigid walker's feet roll without slip"


def _of_friction(scene: Any) -> str | None:
    if isinstance(getattr(scene, "friction", None), Frictionless):
        return "its friction is Frictionless"
    return _of_slip(scene)


def lacks_swing(scene: Any) -> str | None:
    """Why no foot of a scene swings past the ground, or None if one does."""
    rule = getattr(scene, "clearance", None)
    if rule is None or isinstance(
        rule.admits(scene.mechanism.structure.legs[0], jnp.ones(())), jax.Array
    ):
        return None
    return f"its clearance rule is {type(rule).__name__}, which lets no foot pass"


_OF_MOTORS = ("motor", _of_motors)
NAMED_COSTS = {
    "torque_squared": NamedCost(
        Quantity("integral of the squared torques", r"$\int u^2$", "N^2 m^2 s"),
        _integral(_squares_of_torques),
        *_OF_MOTORS,
    ),
    "absolute_work": NamedCost(
        Quantity("absolute work of the motors", "$W_a$", "J"),
        _integral(_absolute_powers, corners=_powers),
        *_OF_MOTORS,
    ),
    "motor_work": NamedCost(
        Quantity("work of the motors", "$W$", "J"),
        _integral(_driving_power, corners=_motor_powers, at_strike=_driving_push_off),
        "",
        _of_motors,
    ),
    "push_off_squared": NamedCost(
        Quantity("half of the squared push-off", r"$\frac{1}{2} P^2$", "N^2 s^2"),
        _integral(_nothing, at_strike=_half_square_of_push_off),
        "",
        _of_push_off,
    ),
    "landing_speed": NamedCost(
        Quantity("speed at which the feet come down", "$v_n$", "m/s"),
        _integral(_nothing, at_strike=_landing_speed),
        "",
        _of_strikes,
    ),
    "impact_loss": NamedCost(
        Quantity("energy lost in impacts", "$E_i$", "J"),
        _integral(_power_of_impacts, at_strike=_push_off_work, at_reset=_lost_at_reset),
        "",
        _of_all,
    ),
    "friction_loss": NamedCost(
        Quantity("energy lost to friction", "$E_f$", "J"),
        _integral(_power_of_friction),
        "",
        _of_friction,
    ),
    "slip_distance": NamedCost(
        Quantity("slip distance", "$s$", "m"),
        _integral(_slip_speed, corners=_corners_of_slip),
        "",
        _of_slip,
    ),
    "jerk": NamedCost(
        Quantity("integral of the squared angular jerk", "$j$", "rad^2/s^5"),
        _integral(_square_of_jerk),
        "",
        _of_all,
    ),
    "peak_torque": NamedCost(
        Quantity("largest torque of a motor", "$u$", "N m"),
        _extremes(_largest_torque, 1.0),
        *_OF_MOTORS,
    ),
    "peak_power": NamedCost(
        Quantity("largest power of a motor", "$P$", "W"),
        _extremes(_largest_power, 1.0),
        *_OF_MOTORS,
    ),
    "joint_range": NamedCost(
        Quantity("range of an angle", r"$\Delta\varphi$", "rad"),
        _extremes(_value_of_angle, 1.0, -1.0),
        "angle",
        _of_all,
    ),
    "foot_clearance": NamedCost(
        Quantity("foot clearance", "$h$", "m"),
        _extremes(_clearance, 0.0, 1.0),
        "",
        lacks_swing,
    ),
}
"""By name; `NAME[part]` is that of one motor, or of one angle. Those of a cycle are sums over its
footsteps.

- torque squared: Σ ∫ u² over all torques of motors, see `WalkerMotion.motors`.
- absolute work: Σ ∫ of the size of u φ̇, work of braking too.
- motor work: of each motor where its power is positive, added up, and the push-off's.
- push off squared: ½ P² of each push-off's impulse P.
- landing speed: of the swing foot towards the ground just before the strike; a sum over the strikes
  of a cycle. On rigid feet alone. A gait has a positive one.
- impact loss: work of the normal reactions, and what springs, stops and latches lose; a rigid
  walker's kinetic energy lost in its impacts, after its push-off, and what its joints lose.
- friction loss: work against friction.
- slip distance: path of the feet that touch, along the ground.
- jerk: Σ ∫ (dα/dt)² over the angular accelerations of all free angles.
- peak torque, peak power: the largest size of u and of u φ̇ of any motor along the cycle.
- joint range: largest minus smallest value of an angle, `joint_range[knee_1]`.
- foot clearance: least height of the swinging foot, negative where it passes underground.
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
