"""Push-off: an impulse of the trailing ankle just before the other foot strikes."""

import dataclasses
from typing import ClassVar, Self

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter
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
