"""Numbers, rows and the matrix of capabilities as the pages write them, in Markdown."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

UNKNOWN = "…"
"""Stands for what the results do not hold: the pages may say anything there."""


def small(number: float | None, digits: int = 1) -> str:
    """A number as the pages write it: 1.7e-3, 2.1e-1, 1.6."""
    if number is None:
        return UNKNOWN
    mantissa, exponent = f"{number:.{digits}e}".split("e")
    return mantissa if int(exponent) == 0 else f"{mantissa}e{int(exponent)}"


def row(*cells: str | int | float | None) -> str:
    """A row of a table, numbers as the pages write them; a dash where there is none."""

    def told(cell: str | int | float | None) -> str:
        if cell is None:
            return "–"
        return small(cell) if isinstance(cell, float) else str(cell)

    return f"| {' | '.join(map(told, cells))} |"


def fixed(found: Mapping[str, Any], digits: int, *names: str) -> list[str]:
    """Some of the numbers with so many digits behind the point."""
    return [f"{found[name]:.{digits}f}" for name in names]


def markdown(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table."""
    return "\n".join(row(*line) for line in (heads, ["---"] * len(heads), *lines))


def percents(number: float) -> str:
    """A fraction as the pages write it."""
    return f"{100.0 * number:.1f}"


def table(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Lines of the page: the table, then each sentence by the letter that stands in the cells."""
    columns = list(rows[0]["cells"])
    letters: dict[str, str] = {}
    yield row("capability", *columns, "what the number is")
    yield "|" + "---|" * (len(columns) + 2)
    for each in rows:
        shown = [_cell(each["cells"][column], letters) for column in columns]
        yield row(each["capability"], *shown, each["number"])
    if letters:
        yield ""
    for sentence, letter in letters.items():
        yield f"- ({letter}) {sentence}"


def _cell(value: Any, letters: dict[str, str]) -> str:
    """A number as the pages write it, or the letter of a sentence."""
    if isinstance(value, str):
        return f"({letters.setdefault(value, _letter(len(letters)))})"
    if isinstance(value, int):
        return str(value)
    return f"{value:.4f}" if 1e-3 <= abs(value) < 1e3 else small(value)


def _letter(number: int) -> str:
    alphabet = "abcdefghijklmnopqrstuvwxyz"
    return alphabet[number] if number < 26 else alphabet[number // 26 - 1] + alphabet[number % 26]
