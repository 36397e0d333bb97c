"""Quantities: what a number stands for, in words, as a symbol and with its SI unit.

The one place that knows how a unit is written: in files, in text and in figures.
"""

import re
from typing import NamedTuple

_SUPERSCRIPTS = str.maketrans("0123456789n", "⁰¹²³⁴⁵⁶⁷⁸⁹ⁿ")


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
        return re.sub(r"\^(\w)(?![\w.])", _superscript, self.unit).replace(" ", "·") or "–"

    @property
    def unit_in_figure(self) -> str:
        """The unit as figures show it, "N s/m²"; "–" for a pure number."""
        digits = re.sub(r"\^(\d)(?![\w.])", _superscript, self.unit)
        return re.sub(r"\^([\w.]+)", r"$^{\1}$", digits) or "–"

    def in_row(self) -> str:
        """Words and symbol."""
        return f"{self.words}, {self.symbol}" if self.symbol else self.words

    def on_axis(self, unit: str | None = None) -> str:
        """Words, symbol and unit, its own unless given another."""
        return f"{self.in_row()} ({self.unit_in_figure if unit is None else unit})"


def _superscript(found: re.Match[str]) -> str:
    return found[1].translate(_SUPERSCRIPTS)
