"""Options of the commands: the actuators of a scene, each by its numbers."""

import dataclasses
from typing import Any

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._parameter import parameter_infos
from jaxbiped.scene.actuation._abstract_actuator import AbstractActuator, Actuation
from jaxbiped.scene.actuation._catalogue import ACTUATORS


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

    def actuation(self) -> Actuation:
        """The actuators that were asked for, None where none was; raises `ArgumentError`."""
        parts = []
        for name, kind in ACTUATORS.items():
            texts = getattr(self, name.replace("-", "_"))
            if texts:
                parts.append(_actuator(name, kind, texts))
        return tuple(parts) or None


def _actuator(
    option: str, kind: type[AbstractActuator], texts: tuple[str, ...]
) -> AbstractActuator:
    infos, values = parameter_infos(kind), {}
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for text in texts:
        name, given, value = (part.strip() for part in text.partition("="))
        if not name or not given:
            raise ArgumentError(f"{option} = {text!r} is not allowed: write name=value.")
        check_choice(f"{option}'s name", name, fields)
        values[name] = _value(option, name, value) if name in infos else value
    for name, field in fields.items():
        if field.default is dataclasses.MISSING and name not in values:
            raise ArgumentError(f"{option} needs {name}=value, its {infos[name].quantity.words}.")
    return kind(**values)


def _value(option: str, name: str, text: str) -> Any:
    """A number, or several between commas."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        raise ArgumentError(
            f"{option} = '{name}={text}' is not allowed: {name} must be a number, and {text!r} is "
            "none."
        ) from None
    return numbers if len(numbers) > 1 else numbers[0]
