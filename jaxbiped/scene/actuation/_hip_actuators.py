"""Actuators at the hip: spring, constant torque, pulse and spline of torque over the phase."""

import dataclasses
from typing import ClassVar, Self

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import ArgumentError, holds_somewhere
from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.actuation._abstract_actuator import (
    AbstractHipActuator,
    AbstractPhaseTorque,
    HipMotion,
    LegTorques,
)


class HipSpring(AbstractHipActuator):
    """A torque −k (θ − θ0) − b θ̇ on the swing leg, the opposite on the other; θ is between them.

    Without a rest angle nothing drives it, and it is the same in either leg's stance. A rest angle
    that is always ahead of the stance leg takes a motor, whose part is the torque k θ0; it changes
    sides with the load.

    Source: Kuo 2002, Energetics of actively powered locomotion using the simplest walking model,
    whose hip spring has no damper.

    Attributes (leaves of any batch shape):
        k: stiffness [N·m/rad].
        b: damping [N·m·s/rad].
        theta_0: how far the swing leg is ahead of the stance leg at rest [rad]; None for 0 and no
            motor.

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
        torque: positive where it drives the walker downhill [N·m].
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
        pulse: largest torque, positive where it drives the walker downhill [N·m].
        phase: where it is: minus the stance leg's angle, 0 when that leg is upright [rad].
        width: over which it falls by 1/e [rad].
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
        off = (phase - self.phase) / self.width
        return self.pulse * jnp.exp(-off * off)

    def idle(self) -> Self:
        return dataclasses.replace(self, pulse=0.0 * self.pulse)


_DIFFERENCE = (1.0 / 6.0, -4.0 / 6.0, 1.0, -4.0 / 6.0, 1.0 / 6.0)


class HipSpline(AbstractPhaseTorque):
    """Σ τ_i B(φ/h − i), cubic B-splines at n phases of equal distance h; the parameters τ_1 … τ_n.

    Twice continuously differentiable; it falls to zero within 2 h before the first phase and
    beyond the last. Where all τ_i are equal, so is the torque from the second phase to the last but
    one.

    Source: de Boor, A Practical Guide to Splines (2001), chapter IX.

    Attributes (leaves of any batch shape):
        torque: coefficients τ_1 … τ_n, two or more, positive where they drive the walker downhill
            [N·m]; parameters by the names `torque_1` and so on.
        first, last: phases of the first and the last: minus the stance leg's angle [rad].
        reaction: see `AbstractPhaseTorque`.

    Raises:
        ArgumentError: fewer than two coefficients, last not above first, or an unknown reaction.
    """

    name: ClassVar[str] = "hip-spline"
    torque: tuple[Parameter, ...] = parameter("hip torque", r"$\tau$", "N m", several=True)
    first: Parameter = parameter("first phase", r"$\varphi_1$", "rad", default=-0.2)
    last: Parameter = parameter("last phase", r"$\varphi_n$", "rad", default=0.2)
    reaction: str = eqx.field(static=True, default="swing")

    def __check_init__(self) -> None:
        if len(self.torque) < 2:
            raise ArgumentError(
                f"torque has length {len(self.torque)}, which is not allowed: give two or more "
                "coefficients."
            )
        if holds_somewhere(self.last <= self.first):
            raise ArgumentError(
                f"last = {self.last} is not allowed with first = {self.first}: it must be above."
            )

    def torque_at(self, phase: Scalar) -> Scalar:
        count = len(self.torque)
        place = (phase - self.first) * (count - 1) / (self.last - self.first)
        cubes = []
        for j in range(count + 4):
            beyond = jnp.maximum(place + (2.0 - j), 0.0)
            cubes.append(beyond * beyond * beyond)
        splines = (
            sum(weight * cubes[i + j] for j, weight in enumerate(_DIFFERENCE)) for i in range(count)
        )
        return jnp.asarray(sum(a * b for a, b in zip(self.torque, splines, strict=True)))

    def idle(self) -> Self:
        return dataclasses.replace(self, torque=tuple(0.0 * each for each in self.torque))
