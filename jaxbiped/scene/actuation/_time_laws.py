"""Laws of the time since the last strike, and a saturation of any law.

They are torques at the hip, and laws of motors at the joints of a mechanism.
"""

import abc
import dataclasses
from typing import Any, ClassVar, Self

import equinox as eqx
import jax.numpy as jnp
from equinox import AbstractVar

from jaxbiped._checks import ArgumentError
from jaxbiped._jax_versions import tanh
from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene._joint_parts import law_of, takes_the_motion
from jaxbiped.scene.actuation._actuators import (
    AbstractStanceTorque,
    check_coefficients,
    spline_between,
)

_IDLE = 1e-6
"""Share of its limit that a law without a strength of its own keeps where it is idle."""


class AbstractTimeTorque(AbstractStanceTorque):
    """A torque that is a function of the time since the last strike, and stays beyond its span.

    At the span its slope jumps, unless the function is flat there.

    Attributes:
        torque: numbers of the function [N·m].
        span: time beyond which it has its last value [s].
        least: how many numbers are needed. A property of the class.
    """

    least: ClassVar[int] = 1
    torque: AbstractVar[tuple[Parameter, ...]]
    span: AbstractVar[Parameter]

    def __check_init__(self) -> None:
        check_coefficients("torque", self.torque, self.least)

    def __call__(self, motion: Any) -> Scalar:
        time = motion.time
        return self.torque_after(jnp.where(time < self.span, time, self.span))

    @abc.abstractmethod
    def torque_after(self, time: Scalar) -> Scalar:
        """Torque at a time up to the span [N·m]."""

    def idle(self) -> Self:
        return dataclasses.replace(self, torque=tuple(0.0 * number for number in self.torque))


class TimePolynomial(AbstractTimeTorque):
    """Σ c_k (t/span)^k of the time t since the last strike; beyond the span, Σ c_k.

    Attributes (leaves of any batch shape):
        torque: coefficients c_0, c_1, …, one or more [N·m]; parameters `torque_1` and so on. At the
            hip, they drive the walker downhill where they are positive.
        span: see above [s].
        reaction: see `AbstractStanceTorque`.

    Raises:
        ArgumentError: no coefficient, a span not above 0, or an unknown reaction.
    """

    name: ClassVar[str] = "time-polynomial"
    torque: Parameter = parameter("torque over time", r"$\tau$", "N m", several=True)
    span: Parameter = parameter("span of the torque", r"$t_\tau$", "s", positive=True)
    reaction: str = eqx.field(static=True, default="swing")

    def torque_after(self, time: Scalar) -> Scalar:
        place, total = time / self.span, self.torque[-1]
        for coefficient in self.torque[-2::-1]:
            total = total * place + coefficient
        return jnp.asarray(total)


class TimeSpline(AbstractTimeTorque):
    """Σ τ_i B(t/h − i + 2), a cubic spline of the time t since the last strike, in n − 3 intervals.

    With n coefficients, h = span/(n − 3), and i from 1 to n. The B-splines are those of `HipSpline`
    on equidistant knots; their sum is 1 from 0 to the span, beyond which the torque stays.

    Source: de Boor, A Practical Guide to Splines (2001), chapter IX.

    Attributes (leaves of any batch shape):
        torque: coefficients τ_1 … τ_n, four or more [N·m]; parameters `torque_1` and so on. At the
            hip, they drive the walker downhill where they are positive.
        span: see above [s].
        reaction: see `AbstractStanceTorque`.

    Raises:
        ArgumentError: fewer than four coefficients, a span not above 0, or an unknown reaction.
    """

    least: ClassVar[int] = 4
    name: ClassVar[str] = "time-spline"
    torque: Parameter = parameter("torque over time", r"$\tau$", "N m", several=True)
    span: Parameter = parameter("span of the torque", r"$t_\tau$", "s", positive=True)
    reaction: str = eqx.field(static=True, default="swing")

    def torque_after(self, time: Scalar) -> Scalar:
        return spline_between(self.torque, 0.0 * self.span, self.span, time)


class Limited(AbstractStanceTorque):
    """A law with a smooth saturation: most tanh(law/most).

    It takes any law of a motor, a plain function of the motion, and any torque at the hip of the
    stance leg's motion; it is for motors and for the hip, as these are.

    Attributes:
        law: the law.
        most: limit of the torque's size, not reached [N·m].

    Raises:
        ArgumentError: what is no law, or most not above 0.
    """

    law: Any = eqx.field(converter=law_of)
    most: Parameter = parameter("limit of the torque", r"$\tau_\mathrm{max}$", "N m", positive=True)

    def __check_init__(self) -> None:
        if not takes_the_motion(self.law):
            raise ArgumentError(
                f"law = {self.law!r} is not allowed for Limited: give a law of the motion, such as "
                "Spline, HipSpline or TimeSpline."
            )

    @property  # type: ignore[misc]
    def reaction(self) -> str:  # type: ignore[override]
        """The law's own, or "swing"."""
        return getattr(self.law, "reaction", "swing")

    def __call__(self, motion: Any) -> Scalar:
        return jnp.asarray(self.most * tanh(self.law(motion) / self.most))

    def idle(self) -> Self:
        if isinstance(self.law, AbstractStanceTorque):
            return dataclasses.replace(self, law=self.law.idle())
        return dataclasses.replace(self, most=_IDLE * self.most)
