"""Nested numbers as text: single ones in a list, rows that are alike in a table."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

MOST = 8
"""Numbers of a list that are printed; of a longer one it is said how many there are."""


def tables(numbers: Any, title: str = "") -> Iterator[str]:
    """Lines that show numbers in mappings and lists; what is nested deeper follows below."""
    named = numbers if isinstance(numbers, Mapping) else dict(enumerate(numbers))
    nested = {name: each for name, each in named.items() if _is_nested(each)}
    plain = {name: each for name, each in named.items() if name not in nested}
    rows = [{"": name} | _plain(each) for name, each in nested.items()]
    if plain:
        yield from ("", title, *_aligned([[str(name), _cell(plain[name])] for name in plain]))
    elif all(len(row) > 1 for row in rows):
        heads = list(dict.fromkeys(head for row in rows for head in row))
        lines = [[_cell(row.get(head)) for head in heads] for row in rows]
        yield from ("", title, *_aligned([heads, *lines]))
        nested = {
            f"{name}, {key}": each
            for name, row in nested.items()
            for key, each in row.items()
            if _is_nested(each)
        }
    for name, each in nested.items():
        yield from tables(each, f"{title}, {name}" if title else str(name))


def _is_nested(value: Any) -> bool:
    """Whether it is a mapping, or a list that holds one."""
    inner = value if isinstance(value, list | tuple) else ()
    return isinstance(value, Mapping) or any(map(_is_nested, inner))


def _plain(value: Any) -> dict[str, Any]:
    """Entries of a row that go into one line."""
    pairs = value.items() if isinstance(value, Mapping) else ()
    return {name: each for name, each in pairs if not _is_nested(each)}


def _cell(value: Any) -> str:
    if isinstance(value, list | tuple):
        few = len(value) <= MOST and not any(isinstance(each, list | tuple) for each in value)
        return " ".join(map(_cell, value)) if few else f"{len(value)} entries"
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _aligned(lines: Sequence[Sequence[str]]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        yield "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
