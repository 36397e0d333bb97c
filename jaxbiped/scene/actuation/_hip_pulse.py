"""Pulse of torque at the hip, at some phase of the stance."""

import dataclasses
from typing import ClassVar, Self

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.actuation._abstract_actuator import AbstractPhaseTorque


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
