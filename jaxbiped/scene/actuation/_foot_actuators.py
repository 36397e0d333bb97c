"""Actuators at the feet: push-off of rigid ones, preload of compliant ones."""

import dataclasses
from typing import ClassVar, Self

from jaxbiped._jax_versions import tanh
from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.actuation._abstract_actuator import AbstractActuator


class PushOff(AbstractActuator):
    """An impulse along the trailing leg, from its foot to the hip, at once before heel strike.

    For rigid feet alone. The massless ankle takes its support from the ground under it and lets go.

    Source: Kuo 2002, Energetics of actively powered locomotion using the simplest walking model.

    Attributes (leaves of any batch shape):
        impulse: [N·s].

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

    φ is minus the leg's angle. The massless foot is pressed into the ground by so much while its
    leg trails, and let up again in the swing: normal laws see the penetration δ with this added.
    For compliant feet alone.

    Attributes (leaves of any batch shape):
        extension: of a leg that trails far [m].
        onset: phase at which half of it is reached: minus the leg's angle [rad].
        span: over which it builds up [rad].

    Raises:
        ArgumentError: extension below 0 or span not above 0.
    """

    name: ClassVar[str] = "foot-preload"
    feet: ClassVar[str] = "compliant"
    extension: Parameter = parameter("foot's extension", "$e$", "m", minimum=0.0)
    onset: Parameter = parameter("extension's phase", r"$\varphi_e$", "rad", default=0.1)
    span: Parameter = parameter("extension's span", "$w_e$", "rad", positive=True, default=0.05)

    def set_point(self, angle: Scalar, rate: Scalar) -> tuple[Scalar, Scalar]:
        """How far the foot is extended [m], and how fast it is [m/s]."""
        rise = tanh((-angle - self.onset) / self.span)
        half = 0.5 * self.extension
        return half * (1.0 + rise), -half * (1.0 - rise * rise) * rate / self.span

    def idle(self) -> Self:
        return dataclasses.replace(self, extension=0.0 * self.extension)
