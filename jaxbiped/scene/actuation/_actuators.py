"""Actuators: at the hip a spring and torques over the phase, at the feet push-off and preload.

They are functions of the state alone, smooth and the same for both legs, so that a walker with them
is still an autonomous system whose legs may be exchanged.
"""

import abc
import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias, cast

import equinox as eqx
import jax.numpy as jnp
from equinox import AbstractVar

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_type, holds_somewhere
from jaxbiped._jax_versions import tanh
from jaxbiped._parameter_declaration import AbstractNamedPart, parameter
from jaxbiped._types import Parameter, Scalar

LegTorques: TypeAlias = tuple[Scalar, Scalar]
"""Torques on leg 1 and leg 2 that increase their angles [N·m]."""

REACTIONS = ("swing", "trunk")


class UnknownTimeError(ArgumentError):
    """A law reads the time since the last strike where none is known."""


def known_time(clock: Scalar | None) -> Scalar:
    """The time since the last strike [s].

    Raises:
        UnknownTimeError: none is known.
    """
    if clock is None:
        raise UnknownTimeError(
            "motion.time is not known here, which is not allowed for a law that reads it: give a "
            "state of a Scene or a RigidScene that has the law."
        )
    return clock


ACTUATORS: dict[str, type["AbstractActuator"]] = {}
"""Each actuator by name."""


class HipMotion(NamedTuple):
    """Motion that an actuator at the hip can use; pairs for leg 1 and leg 2.

    Attributes:
        angle: angles from the slope's normal [rad].
        rate: rates of the angles [rad/s].
        load: share of the load that each leg carries [–], one if it stands alone; None for a leg
            that is known to carry nothing.
    """

    angle: tuple[Scalar, Scalar]
    rate: tuple[Scalar, Scalar]
    load: tuple[Scalar | None, Scalar | None]

    @property
    def time(self) -> Scalar:
        """Time since the last strike [s], of a motion that is `timed`."""
        return known_time(None)

    def timed(self, clock: Scalar | None) -> Any:
        """The same with the time since the last strike [s]; as it is where that is None."""
        return self if clock is None else TimedHipMotion(*self, clock)


class TimedHipMotion(NamedTuple):
    """A `HipMotion` whose time since the last strike is known.

    Attributes:
        angle, rate, load: see `HipMotion`.
        time: time since the last strike [s].
    """

    angle: tuple[Scalar, Scalar]
    rate: tuple[Scalar, Scalar]
    load: tuple[Scalar | None, Scalar | None]
    time: Scalar


class AbstractActuator(AbstractNamedPart):
    """A device that drives the walker or stores energy for it; listed in `ACTUATORS` by its `name`.

    Attributes:
        feet: the feet that it needs, "rigid" or "compliant", None for any. A property of the class.
    """

    catalogue: ClassVar[dict[str, Any]] = ACTUATORS
    feet: ClassVar[str | None] = None

    @abc.abstractmethod
    def idle(self) -> Self:
        """The same actuator at strength zero, at which a search for a driven gait may begin."""


class AbstractHipActuator(AbstractActuator):
    """An actuator that turns the legs about the hip."""

    @abc.abstractmethod
    def torques(self, hip: HipMotion) -> LegTorques:
        """Total torque on each leg [N·m]."""

    @abc.abstractmethod
    def motor_torques(self, hip: HipMotion) -> LegTorques | None:
        """Torques of a motor alone, without springs and dampers [N·m]; None without a motor."""


class StanceMotion(NamedTuple):
    """What the law of a torque at the hip knows while a leg stands.

    It is what a motor's law knows, of the angle of the other leg from the one that stands; it
    reads no other angles.

    Attributes:
        hip: the motion.
        leg: the leg that stands, 0 or 1.
    """

    hip: HipMotion | TimedHipMotion
    leg: int

    @property
    def angle(self) -> Scalar:
        """Angle of the other leg from this one [rad]."""
        return self.hip.angle[1 - self.leg] - self.hip.angle[self.leg]

    @property
    def rate(self) -> Scalar:
        """Its rate [rad/s]."""
        return self.hip.rate[1 - self.leg] - self.hip.rate[self.leg]

    @property
    def phase(self) -> Scalar:
        """Minus the angle of the leg that stands [rad]."""
        return -self.hip.angle[self.leg]

    @property
    def phase_rate(self) -> Scalar:
        """Its rate [rad/s]."""
        return -self.hip.rate[self.leg]

    @property
    def time(self) -> Scalar:
        """Time since the last strike [s]."""
        return self.hip.time

    def of(self, angle: Any) -> tuple[Scalar, Scalar]:
        """Not known at the hip; raises `ArgumentError`."""
        raise ArgumentError(
            f"motion.of({angle!r}) is not allowed for an actuator at the hip, which knows only the "
            "legs: give the law to a Motor of a mechanism."
        )


class AbstractStanceTorque(AbstractHipActuator):
    """A torque at the hip that is a law of the motion while a leg stands; a law for a `Motor`, too.

    A positive torque drives the walker downhill: it turns the stance leg back. In double support,
    the torque of each leg is weighted by the load that it carries.

    Attributes:
        reaction: part that takes the opposite torque: "swing", the other leg, which it swings
            forward; or "trunk", an upright trunk that is not modelled. A motor's own angle tells
            it instead.
    """

    reaction: AbstractVar[str]

    def __check_init__(self) -> None:
        check_choice("reaction", self.reaction, REACTIONS)

    @abc.abstractmethod
    def __call__(self, motion: Any) -> Scalar:
        """Torque while a leg stands, from what is known of the motion then [N·m]."""

    def torques(self, hip: HipMotion) -> LegTorques:
        driving = [
            None if load is None else load * self(StanceMotion(hip, leg))
            for leg, load in enumerate(hip.load)
        ]
        legs = []
        for own, other in (driving, driving[::-1]):
            back = 0.0 if own is None else own
            forward = 0.0 if other is None or self.reaction == "trunk" else other
            legs.append(jnp.asarray(forward - back))
        return legs[0], legs[1]

    def motor_torques(self, hip: HipMotion) -> LegTorques:
        return self.torques(hip)


class AbstractPhaseTorque(AbstractStanceTorque):
    """A torque at the hip that is a function of the phase: how far the stance leg has turned.

    The phase is minus the stance leg's angle [rad], which grows as the walker rolls over that leg.
    The torque does not depend on time, so the system stays autonomous.

    Attributes:
        reaction: see `AbstractStanceTorque`.
    """

    def __call__(self, motion: Any) -> Scalar:
        return self.torque_at(motion.phase)

    @abc.abstractmethod
    def torque_at(self, phase: Scalar) -> Scalar:
        """Torque at a phase [rad], positive if it drives the walker downhill [N·m]."""


Actuation: TypeAlias = Any
"""A tuple of a scene's actuators, None where it is passive; users also write one actuator."""


def actuation_of(parts: AbstractActuator | Sequence[AbstractActuator] | None) -> Actuation:
    """One part, several or none as a scene keeps them."""
    if parts is None:
        return None
    if isinstance(parts, AbstractActuator):
        return (parts,)
    # What is neither is refused by `check_actuation`, with what it is.
    return tuple(parts) or None if isinstance(parts, list | tuple) else (cast(Any, parts),)


def check_actuation(actuation: Actuation, feet: str, *, mirrored: bool) -> None:
    """Raises `ArgumentError` for what is no actuator, or one that such a walker cannot have.

    Args:
        actuation: the actuators.
        feet: kind of the walker's feet, "compliant" or "rigid".
        mirrored: whether it has a pair of bodies, which an actuator at the hip acts between.
    """
    for part in actuation or ():
        check_type("actuation", part, AbstractActuator)
        if part.feet not in (None, feet):
            raise ArgumentError(
                f"actuation = {type(part).__name__} is not allowed with {feet} feet: it needs "
                f"{part.feet} ones."
            )
        if isinstance(part, AbstractHipActuator) and not mirrored:
            raise ArgumentError(
                f"actuation = {type(part).__name__} is not allowed for a mechanism without a "
                "mirror: it acts between the bodies of a pair; give mirror= or use joint parts."
            )


_DIFFERENCE = (1.0 / 6.0, -4.0 / 6.0, 1.0, -4.0 / 6.0, 1.0 / 6.0)


def pulse(height: Scalar, centre: Scalar, width: Scalar, place: Scalar) -> Scalar:
    """height exp(−((place − centre)/width)²)."""
    off = (place - centre) / width
    return height * jnp.exp(-off * off)


def check_spline(coefficients: tuple[Scalar, ...], first: Scalar, last: Scalar) -> None:
    """Raises `ArgumentError` for fewer than two coefficients, or a last place not above the first.

    The coefficients are those of a field `torque`.
    """
    check_coefficients("torque", coefficients, 2)
    check_places(first, last)


def check_coefficients(name: str, coefficients: tuple[Scalar, ...], least: int) -> None:
    """Raises `ArgumentError` for fewer coefficients of this name than are needed."""
    if len(coefficients) < least:
        number = {1: "one", 2: "two", 4: "four"}[least]
        raise ArgumentError(
            f"{name} has length {len(coefficients)}, which is not allowed: give {number} or more "
            "coefficients."
        )


def check_places(first: Scalar, last: Scalar) -> None:
    """Raises `ArgumentError` for a last place that is not above the first."""
    check_finite("first", first)
    check_finite("last", last)
    if holds_somewhere(last <= first):
        raise ArgumentError(f"last = {last} is not allowed with first = {first}: it must be above.")


def cubic_spline(
    coefficients: tuple[Scalar, ...], first: Scalar, last: Scalar, place: Scalar
) -> Scalar:
    """Σ c_i B(place/h − i), cubic B-splines at n places of equal distance h, first to last.

    Source: de Boor, A Practical Guide to Splines (2001), chapter IX.
    """
    count = len(coefficients)
    at = (place - first) * (count - 1) / (last - first)
    cubes = []
    for j in range(count + 4):
        beyond = jnp.maximum(at + (2.0 - j), 0.0)
        cubes.append(beyond * beyond * beyond)
    splines = (
        sum(weight * cubes[i + j] for j, weight in enumerate(_DIFFERENCE)) for i in range(count)
    )
    return jnp.asarray(sum(a * b for a, b in zip(coefficients, splines, strict=True)))


def spline_between(
    coefficients: tuple[Scalar, ...], first: Scalar, last: Scalar, place: Scalar
) -> Scalar:
    """The cubic spline of n coefficients on n − 3 equal intervals from the first place to the last.

    They are those of cubic B-splines on equidistant knots, whose sum there is 1.
    """
    interval = (last - first) / (len(coefficients) - 3)
    return cubic_spline(coefficients, first - interval, last + interval, place)


class HipSpring(AbstractHipActuator):
    """Torque −k (θ − θ0) − b θ̇ on the swing leg, its opposite on the other; θ is between them.

    Without a rest angle, the spring is passive and acts equally in the stance of either leg. A rest
    angle that is always ahead of the stance leg requires a motor, which contributes the torque k
    θ0; it changes sides with the load.

    Source: Kuo 2002, Energetics of actively powered locomotion using the simplest walking model,
    whose hip spring has no damper.

    Attributes (leaves of any batch shape):
        k: stiffness [N·m/rad].
        b: damping [N·m·s/rad].
        theta_0: rest angle of the swing leg ahead of the stance leg [rad]; None for 0 and no motor.

    Raises:
        ArgumentError: k or b below 0.
    """

    name: ClassVar[str] = "hip-spring"
    k: Parameter = parameter("hip stiffness", "$k$", "N m/rad", minimum=0.0)
    b: Parameter = parameter("hip damping", "$b$", "N m s/rad", minimum=0.0, default=0.0)
    theta_0: Parameter | None = parameter("hip's rest angle", r"$\theta_0$", "rad", default=None)

    def torques(self, hip: HipMotion) -> LegTorques:
        on_leg_1 = -self.k * (hip.angle[0] - hip.angle[1]) - self.b * (hip.rate[0] - hip.rate[1])
        motor = self.motor_torques(hip)
        if motor is not None:
            on_leg_1 = on_leg_1 + motor[0]
        return on_leg_1, -on_leg_1

    def motor_torques(self, hip: HipMotion) -> LegTorques | None:
        if self.theta_0 is None:
            return None
        first, second = (0.0 if load is None else load for load in hip.load)
        torque = self.k * self.theta_0 * (second - first)
        return torque, -torque

    def idle(self) -> Self:
        return dataclasses.replace(self, k=0.0 * self.k, b=0.0 * self.b)


class HipTorque(AbstractPhaseTorque):
    """The same torque at every phase.

    Attributes (leaves of any batch shape):
        torque: torque, positive if it drives the walker downhill [N·m].
        reaction: see `AbstractPhaseTorque`.

    Raises:
        ArgumentError: an unknown reaction.
    """

    name: ClassVar[str] = "hip-torque"
    torque: Parameter = parameter("hip torque", r"$\tau$", "N m")
    reaction: str = eqx.field(static=True, default="swing")

    def torque_at(self, phase: Scalar) -> Scalar:
        return self.torque

    def idle(self) -> Self:
        return dataclasses.replace(self, torque=0.0 * self.torque)


class HipPulse(AbstractPhaseTorque):
    """A torque pulse exp(−((φ − phase)/width)²) at the phase φ.

    Attributes (leaves of any batch shape):
        pulse: largest torque, positive if it drives the walker downhill [N·m].
        phase: phase of the peak: minus the stance leg's angle, 0 when that leg is upright [rad].
        width: distance from the peak at which the torque has fallen to 1/e [rad].
        reaction: see `AbstractPhaseTorque`.

    Raises:
        ArgumentError: width not above 0, or an unknown reaction.
    """

    name: ClassVar[str] = "hip-pulse"
    pulse: Parameter = parameter("largest hip torque", r"$\tau$", "N m")
    phase: Parameter = parameter("phase of the pulse", r"$\varphi$", "rad", default=0.0)
    width: Parameter = parameter("width of the pulse", "$w$", "rad", positive=True, default=0.1)
    reaction: str = eqx.field(static=True, default="swing")

    def torque_at(self, phase: Scalar) -> Scalar:
        return pulse(self.pulse, self.phase, self.width, phase)

    def idle(self) -> Self:
        return dataclasses.replace(self, pulse=0.0 * self.pulse)


class HipSpline(AbstractPhaseTorque):
    """Σ τ_i B(φ/h − i), cubic B-splines at n phases of equal distance h; the parameters τ_1 … τ_n.

    The torque is twice continuously differentiable. It falls to zero within 2 h before the first
    phase and beyond the last. If all τ_i are equal, the torque is constant from the second phase to
    the last but one.

    Source: de Boor, A Practical Guide to Splines (2001), chapter IX.

    Attributes (leaves of any batch shape):
        torque: coefficients τ_1 … τ_n, two or more, positive if they drive the walker downhill
            [N·m]; the parameters are named `torque_1` and so on.
        first, last: phases of the first and the last coefficient: minus the stance leg's angle
            [rad].
        reaction: see `AbstractPhaseTorque`.

    Raises:
        ArgumentError: fewer than two coefficients, last not above first, or an unknown reaction.
    """

    name: ClassVar[str] = "hip-spline"
    torque: Parameter = parameter("hip torque", r"$\tau$", "N m", several=True)
    first: Parameter = parameter("first phase", r"$\varphi_1$", "rad", default=-0.2)
    last: Parameter = parameter("last phase", r"$\varphi_n$", "rad", default=0.2)
    reaction: str = eqx.field(static=True, default="swing")

    def __check_init__(self) -> None:
        check_spline(self.torque, self.first, self.last)

    def torque_at(self, phase: Scalar) -> Scalar:
        return cubic_spline(self.torque, self.first, self.last, phase)

    def idle(self) -> Self:
        return dataclasses.replace(self, torque=tuple(0.0 * each for each in self.torque))


class PushOff(AbstractActuator):
    """An impulse along the trailing leg, from its foot to the hip, just before heel strike.

    For rigid feet only. The massless ankle pushes against the ground and then releases it.

    Source: Kuo 2002, Energetics of actively powered locomotion using the simplest walking model.

    Attributes (leaves of any batch shape):
        impulse: impulse [N·s].

    Raises:
        ArgumentError: impulse below 0.
    """

    name: ClassVar[str] = "push-off"
    feet: ClassVar[str] = "rigid"
    impulse: Parameter = parameter("push-off impulse", "$P$", "N s", minimum=0.0)

    def idle(self) -> Self:
        return dataclasses.replace(self, impulse=0.0 * self.impulse)


class FootPreload(AbstractActuator):
    """The foot's set point, (extension/2) (1 + tanh((φ − onset)/span)) below the leg's own.

    φ is minus the leg's angle. The massless foot is pressed into the ground by this distance while
    its leg trails, and retracted in the swing: the normal law receives the penetration δ with this
    distance added. For compliant feet only.

    Attributes (leaves of any batch shape):
        extension: full extension, of a leg that trails far [m].
        onset: phase at which half of it is reached: minus the leg's angle [rad].
        span: range of the phase over which it builds up [rad].

    Raises:
        ArgumentError: extension below 0 or span not above 0.
    """

    name: ClassVar[str] = "foot-preload"
    feet: ClassVar[str] = "compliant"
    extension: Parameter = parameter("foot's extension", "$e$", "m", minimum=0.0)
    onset: Parameter = parameter("extension's phase", r"$\varphi_e$", "rad", default=0.1)
    span: Parameter = parameter("extension's span", "$w_e$", "rad", positive=True, default=0.05)

    def set_point(self, angle: Scalar, rate: Scalar) -> tuple[Scalar, Scalar]:
        """Extension of the foot [m], and its rate [m/s]."""
        rise = tanh((-angle - self.onset) / self.span)
        half = 0.5 * self.extension
        return half * (1.0 + rise), -half * (1.0 - rise * rise) * rate / self.span

    def idle(self) -> Self:
        return dataclasses.replace(self, extension=0.0 * self.extension)
