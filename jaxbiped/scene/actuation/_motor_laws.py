"""Laws of motors at the joints of a mechanism: a torque as a function of the motion.

A law sees a motion: `motion.angle` and `motion.rate` of the motor's own angle, `motion.of(angle)`
of any other, `motion.phase` and `motion.phase_rate`, minus those of the leg that stands, and
`motion.time` since the last strike.
"""

import abc
import dataclasses
from typing import Any, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
from equinox import AbstractVar

from jaxbiped._parameter_declaration import AbstractPart, parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene._joint_parts import Angle, angle_of
from jaxbiped.scene.actuation._actuators import (
    check_coefficients,
    check_places,
    check_spline,
    cubic_spline,
    pulse,
    spline_between,
)


class JointMotion(Protocol):
    """What the law of a motor may know.

    Attributes:
        angle, rate: of the motor's own angle [rad, rad/s].
        phase, phase_rate: minus the angle of the leg that stands, and its rate [rad, rad/s].
        time: time since the last strike [s]; a scene with a law that reads it has a clock.
    """

    @property
    def angle(self) -> Scalar: ...
    @property
    def rate(self) -> Scalar: ...
    @property
    def phase(self) -> Scalar: ...
    @property
    def phase_rate(self) -> Scalar: ...
    @property
    def time(self) -> Scalar: ...
    def of(self, angle: Any) -> tuple[Scalar, Scalar]:
        """Value [rad] and rate [rad/s] of any other angle."""
        ...


class AbstractMotorLaw(AbstractPart):
    """The torque of a motor as a function of the motion; its numeric leaves are parameters."""

    @abc.abstractmethod
    def __call__(self, motion: JointMotion) -> Scalar:
        """Torque [N·m], positive where it increases the motor's angle."""


class AbstractReadingLaw(AbstractMotorLaw):
    """A law that reads one angle.

    Attributes:
        of: the angle, a body's name or weights of absolute angles by name; None for the law's own
            choice.
    """

    of: AbstractVar[Angle | None]

    def read(self, motion: JointMotion) -> tuple[Scalar, Scalar] | None:
        """The angle that is read [rad] and its rate [rad/s]; None without `of`."""
        if self.of is None:
            return None
        return motion.of(self.of if isinstance(self.of, str) else dict(self.of))


class Constant(AbstractMotorLaw):
    """A constant torque; for a motor by role, for as long as the motor's leg stands.

    Attributes (leaves of any batch shape):
        torque: torque [N·m].
    """

    torque: Parameter = parameter("motor torque", r"$\tau$", "N m")

    def __call__(self, motion: JointMotion) -> Scalar:
        return self.torque


class PD(AbstractReadingLaw):
    """A proportional and derivative controller: τ = −kp (φ − target) − kd φ̇.

    Attributes (leaves of any batch shape):
        kp: gain of the angle [N·m/rad].
        kd: gain of its rate [N·m·s/rad]; None for none.
        target: target of the angle [rad]; None for 0.
        of: the angle φ. Default: the motor's own.
    """

    kp: Parameter = parameter("proportional gain", r"$k_\mathrm{p}$", "N m/rad")
    kd: Parameter | None = parameter(
        "derivative gain", r"$k_\mathrm{d}$", "N m s/rad", default=None
    )
    target: Parameter | None = parameter("target angle", r"$\varphi_0$", "rad", default=None)
    _: dataclasses.KW_ONLY
    of: Angle | None = eqx.field(static=True, converter=angle_of, default=None)

    def __call__(self, motion: JointMotion) -> Scalar:
        angle, rate = self.read(motion) or (motion.angle, motion.rate)
        torque: Scalar = -self.kp * (angle if self.target is None else angle - self.target)
        return torque if self.kd is None else torque - self.kd * rate


class Pulse(AbstractReadingLaw):
    """A pulse τ exp(−((φ − at)/width)²).

    Attributes (leaves of any batch shape):
        torque: largest torque [N·m].
        at: angle of the peak [rad].
        width: distance from the peak at which the torque has fallen to 1/e [rad].
        of: the angle φ. Default: the phase.

    Raises:
        ArgumentError: width not above 0.
    """

    torque: Parameter = parameter("largest motor torque", r"$\tau$", "N m")
    at: Parameter = parameter("phase of the pulse", r"$\varphi$", "rad")
    width: Parameter = parameter("width of the pulse", "$w$", "rad", positive=True)
    _: dataclasses.KW_ONLY
    of: Angle | None = eqx.field(static=True, converter=angle_of, default=None)

    def __call__(self, motion: JointMotion) -> Scalar:
        read = self.read(motion)
        return pulse(self.torque, self.at, self.width, motion.phase if read is None else read[0])


class Spline(AbstractReadingLaw):
    """Σ τ_i B(φ/h − i), cubic B-splines at n angles of equal distance h: see `HipSpline`.

    Attributes (leaves of any batch shape):
        torque: coefficients τ_1 … τ_n, two or more [N·m]; parameters `torque_1` and so on.
        first, last: angles of the first and the last coefficient [rad].
        of: the angle φ. Default: the phase.

    Raises:
        ArgumentError: fewer than two coefficients, or last not above first.
    """

    torque: Parameter = parameter("motor torque", r"$\tau$", "N m", several=True)
    first: Parameter = parameter("first phase", r"$\varphi_1$", "rad")
    last: Parameter = parameter("last phase", r"$\varphi_n$", "rad")
    _: dataclasses.KW_ONLY
    of: Angle | None = eqx.field(static=True, converter=angle_of, default=None)

    def __check_init__(self) -> None:
        check_spline(self.torque, self.first, self.last)

    def __call__(self, motion: JointMotion) -> Scalar:
        read = self.read(motion)
        place = motion.phase if read is None else read[0]
        return cubic_spline(self.torque, self.first, self.last, place)


class VirtualConstraint(AbstractReadingLaw):
    """A controller that holds an output on a function of the phase, which grows through a step.

    τ = −kp (y − h(φ)) − kd (ẏ − h'(φ) φ̇) for the output y, a cubic spline h in n − 3 equal
    intervals from the first phase to the last, and the phase φ of the leg that stands. Beyond them
    h goes on along its tangents. The coefficients are those of B-splines on equidistant knots,
    whose sum is 1: if they are equal, h is.

    Source: Grizzle, Abba and Plestan 2001, Asymptotically stable walking for biped robots: analysis
    via systems with impulse effects, IEEE Transactions on Automatic Control 46, 51.

    Attributes (leaves of any batch shape):
        kp: gain of the output [N·m/rad].
        kd: gain of its rate [N·m·s/rad].
        output: coefficients of h, four or more [rad]; parameters `output_1` and so on.
        first, last: the phases [rad].
        of: the output y. Default: the motor's own angle.

    Raises:
        ArgumentError: fewer than four coefficients, or last not above first.
    """

    kp: Parameter = parameter("proportional gain", r"$k_\mathrm{p}$", "N m/rad")
    kd: Parameter = parameter("derivative gain", r"$k_\mathrm{d}$", "N m s/rad")
    output: Parameter = parameter("constrained output", "$h$", "rad", several=True)
    first: Parameter = parameter("first phase", r"$\varphi_1$", "rad")
    last: Parameter = parameter("last phase", r"$\varphi_n$", "rad")
    _: dataclasses.KW_ONLY
    of: Angle | None = eqx.field(static=True, converter=angle_of, default=None)

    def __check_init__(self) -> None:
        check_coefficients("output", self.output, 4)
        check_places(self.first, self.last)

    def __call__(self, motion: JointMotion) -> Scalar:
        angle, rate = self.read(motion) or (motion.angle, motion.rate)
        phase = motion.phase
        known = jnp.where(phase < self.first, self.first, phase)
        known = jnp.where(known > self.last, self.last, known)

        def output(place: Scalar) -> Scalar:
            return spline_between(self.output, self.first, self.last, place)

        value, slope = jax.jvp(output, (known,), (jnp.ones_like(known),))
        off = angle - (value + slope * (phase - known))
        return -self.kp * off - self.kd * (rate - slope * motion.phase_rate)
