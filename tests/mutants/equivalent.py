"""Equivalent mutations: those that no test can tell from the program, with the reason for each.

`equivalent.toml` holds them by their text and place, which outlive lines that move.
"""

import tomllib
from pathlib import Path

from tests.mutants.drawing import Drawn
from tests.mutants.mutations import EQUIVALENT

TABLE = Path(__file__).parent / EQUIVALENT


_FIELDS = ("file", "within", "statement", "stands", "instead")


def reasons(table: Path = TABLE) -> dict[tuple[str, ...], str]:
    """Why each is equivalent, by its `Drawn.place`."""
    rows = tomllib.loads(table.read_text()).get("equivalent", []) if table.exists() else []
    return {(*(row[n] for n in _FIELDS), str(row.get("nth", 0))): row["reason"] for row in rows}


def row_of(drawn: Drawn, reason: str) -> str:
    """The table's entry for a mutation."""
    lines = [f"{name} = {_text(getattr(drawn, name))}" for name in _FIELDS]
    lines += [f"nth = {drawn.nth}"] if drawn.nth else []
    return "\n".join(["[[equivalent]]", *lines, f"reason = {_text(reason)}", ""])


def _text(value: str) -> str:
    if "\n" in value or "'" in value:
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{escaped}"'
    return f"'{value}'"
