"""Quantities: what a number stands for, in words, as a symbol and with its SI unit; and its range.

The one place that knows how a unit is written: in files, in text and in figures.
"""

import contextlib
import math
import re
from typing import NamedTuple

from jaxbiped._checks import (
    check_at_least,
    check_below,
    check_finite,
    check_not_negative,
    check_positive,
)

_EXPONENT = re.compile(r"\^([\w.]+)")
_FORCE_OR_LENGTH = re.compile(r"\b[Nm]\b")
_ANGULAR = {"N": "N m", "m": "rad"}
_BASES, _PLAIN = ("m", "s"), ("rad", "1")
_SUPERSCRIPTS = dict(zip("0123456789n", "⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ", strict=True))
_DEGREE = math.pi / 180.0
_SCALES = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6},
    "N": {"N": 1.0, "kN": 1e3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": _DEGREE, "°": _DEGREE},
    "rad/s": {"rad/s": 1.0, "deg/s": _DEGREE, "°/s": _DEGREE},
    "kg": {"kg": 1.0, "g": 1e-3},
}
"""SI units, and how many of them each unit is."""
_WITH_UNIT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)")


def unit_scales(unit: str | None, given: str = "") -> dict[str, float]:
    """The units for numbers of an SI unit, or of the kind of a `given` one, in SI units."""
    if unit is not None:
        return _SCALES.get(unit, {unit: 1.0})
    return next((scales for scales in _SCALES.values() if given in scales), {given: 1.0})


def si_number(text: str, unit: str | None = None) -> float:
    """The number in SI units that a text means, with a unit as in "2deg" or without one.

    Raises:
        ValueError: it is not a number, or has a unit of another kind than `unit`.
    """
    with contextlib.suppress(ValueError):
        return float(text)
    match = _WITH_UNIT.fullmatch(text.strip())
    scales = unit_scales(unit, match[2]) if match else {}
    if match is None or match[2] not in scales:
        allowed = ", ".join(filter(None, scales))
        raise ValueError(f"{text!r} is not a number" + (f" in {allowed}" if allowed else ""))
    return float(match[1]) * scales[match[2]]


class Quantity(NamedTuple):
    """A quantity; a symbol or a unit that it does not have is an empty text.

    Attributes:
        words: what it is, a few words for a row or an axis.
        symbol: as mathematics that matplotlib sets, "$K$".
        unit: SI unit as files have it, "N s/m^2"; an exponent may be a parameter's name, "N/m^n".
    """

    words: str
    symbol: str = ""
    unit: str = ""

    @property
    def attributes(self) -> dict[str, str]:
        """What a dataset's variable says of it."""
        return {"long_name": self.words, "units": self.unit}

    @property
    def unit_in_text(self) -> str:
        """The unit as tables print it, "N·s/m²"; "–" for a pure number."""
        text = _EXPONENT.sub(lambda found: _SUPERSCRIPTS.get(found[1], found[0]), self.unit)
        return text.replace(" ", "·") or "–"

    @property
    def unit_in_figure(self) -> str:
        """The unit as figures show it, "N s/m²"; "–" for a pure number."""
        return _EXPONENT.sub(_in_figure, self.unit) or "–"

    @property
    def length_and_time(self) -> tuple[float, float]:
        """Powers of the metre and of the second in the unit, which has no mass in it."""
        powers = [0.0, 0.0]
        for sign, part in zip((1.0, -1.0), f"{self.unit}/".split("/"), strict=False):
            for factor in part.split():
                base, _, power = factor.partition("^")
                if base in _BASES:
                    powers[_BASES.index(base)] += sign * float(power or 1.0)
                elif base not in _PLAIN:
                    raise ValueError(f"{self.unit!r} is not made of lengths and times alone")
        return powers[0], powers[1]

    @property
    def angular(self) -> "Quantity":
        """The same of a law between an angle and a torque, not a length and a force: N m/rad^n."""
        return self._replace(unit=_FORCE_OR_LENGTH.sub(lambda found: _ANGULAR[found[0]], self.unit))

    def of_part(self, part: str) -> "Quantity":
        """The same of a part, such as a body, which its words and its symbol name."""
        base, _, index = self.symbol.strip("$").partition("_")
        name = r"\mathrm{" + part.replace("_", r"\_") + "}"
        words = self.words if self.words.endswith(part) else f"{self.words}, {part}"
        symbol = f"${base}_{{{index}{',' if index else ''}{name}}}$" if base else ""
        return self._replace(words=words, symbol=symbol)

    def in_row(self) -> str:
        """Words and symbol."""
        return f"{self.words}, {self.symbol}" if self.symbol else self.words

    def on_axis(self, unit: str | None = None) -> str:
        """Words, symbol and unit. Default: the quantity's own unit."""
        return f"{self.in_row()} ({self.unit_in_figure if unit is None else unit})"


def _in_figure(found: re.Match[str]) -> str:
    exponent = found[1]
    if exponent.isdigit() and exponent in _SUPERSCRIPTS:
        return _SUPERSCRIPTS[exponent]
    return f"$^{exponent}$" if len(exponent) == 1 else f"$^{{{exponent}}}$"


class ParameterInfo(NamedTuple):
    """What the field of a parameter carries.

    Attributes:
        quantity: words, symbol and unit.
        positive: whether it must be above 0.
        minimum: the smallest value allowed, None for none.
        size_below: what its absolute value must be below, None for any.
    """

    quantity: Quantity
    positive: bool = False
    minimum: float | None = None
    size_below: float | None = None

    def check(self, name: str, value: object) -> None:
        """Raises `ArgumentError` unless every entry is a finite number that is allowed."""
        unit = self.quantity.unit
        if self.size_below is not None:
            check_below(name, value, self.size_below, "radians" if unit == "rad" else unit)
        elif self.positive:
            check_positive(name, value, unit)
        elif self.minimum is None:
            check_finite(name, value)
        elif self.minimum == 0.0:
            check_not_negative(name, value, unit)
        else:
            check_at_least(name, value, f"{self.minimum:g}", self.minimum)
