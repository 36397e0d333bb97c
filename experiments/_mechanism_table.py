"""The matrix of capabilities as a table of Markdown, its refusals listed below it."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from _quote_words import row, small


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
