"""Options of the commands: the actuators of a scene, each by its numbers."""

import dataclasses
from typing import TYPE_CHECKING

from jaxbiped._checks import ArgumentError

if TYPE_CHECKING:
    from jaxbiped.scene.actuation._abstract_actuator import Actuation


@dataclasses.dataclass(frozen=True)
class ActuationOptions:
    """What drives the walker beside gravity, each by its numbers as name=value (SI units)."""

    hip_spring: tuple[str, ...] = ()
    """Spring and damper between the legs: k=0.05 b=0.001 theta_0=0.1."""
    hip_torque: tuple[str, ...] = ()
    """Constant torque at the hip: torque=0.1; reaction=trunk takes it from no leg."""
    hip_pulse: tuple[str, ...] = ()
    """Pulse of torque at a phase of the stance: pulse=0.1 phase=0.0 width=0.1."""
    hip_spline: tuple[str, ...] = ()
    """Torque as a spline over phase: torque=0.1,0.2,0.1 first=-0.2 last=0.2."""
    push_off: tuple[str, ...] = ()
    """Impulse of the trailing ankle just before heel strike, on rigid feet: impulse=0.1."""
    foot_preload: tuple[str, ...] = ()
    """Extension of compliant feet that trail: extension=0.003 onset=0.1 span=0.05."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is not written as name=value."""
        for field in dataclasses.fields(self):
            for text in getattr(self, field.name):
                named_text(field.name.replace("_", "-"), text)

    def actuation(self) -> "Actuation":
        """The actuators that were asked for, None where none was; raises `ArgumentError`."""
        from jaxbiped.cli._described import described_actuation

        return described_actuation(self)


def named_text(option: str, text: str) -> tuple[str, str]:
    """Name and value of name=value; raises `ArgumentError`."""
    name, given, value = (part.strip() for part in text.partition("="))
    if not name or not given:
        raise ArgumentError(f"{option} = {text!r} is not allowed: write name=value.")
    return name, value
