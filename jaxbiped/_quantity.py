"""Quantities: what a number stands for, in words, as a symbol and with its SI unit.

The one place that knows how a unit is written: in files, in text and in figures.
"""

import re
from typing import NamedTuple

_EXPONENT = re.compile(r"\^([\w.]+)")
_SUPERSCRIPTS = dict(zip("0123456789n", "⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ", strict=True))


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
    def unit_in_text(self) -> str:
        """The unit as tables print it, "N·s/m²"; "–" for a pure number."""
        return _EXPONENT.sub(_in_text, self.unit).replace(" ", "·") or "–"

    @property
    def unit_in_figure(self) -> str:
        """The unit as figures show it, "N s/m²"; "–" for a pure number."""
        return _EXPONENT.sub(_in_figure, self.unit) or "–"

    def in_row(self) -> str:
        """Words and symbol."""
        return f"{self.words}, {self.symbol}" if self.symbol else self.words

    def on_axis(self, unit: str | None = None) -> str:
        """Words, symbol and unit, its own unless given another."""
        return f"{self.in_row()} ({self.unit_in_figure if unit is None else unit})"


def _in_text(found: re.Match[str]) -> str:
    return _SUPERSCRIPTS.get(found[1], found[0])


def _in_figure(found: re.Match[str]) -> str:
    exponent = found[1]
    if exponent.isdigit() and exponent in _SUPERSCRIPTS:
        return _SUPERSCRIPTS[exponent]
    return f"$^{exponent}$" if len(exponent) == 1 else f"$^{{{exponent}}}$"
