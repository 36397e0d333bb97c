"""Reports for people and for programs."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jaxbiped._files import strict_json

if TYPE_CHECKING:
    from jaxbiped._types import JsonObject


class Report:
    """Prints for people, and writes the same numbers for programs where `--json` says so."""

    def __init__(self, json_path: Path | None) -> None:
        self._path = json_path
        self._only_json = str(json_path) == "-"

    def say(self, text: str = "") -> None:
        """Prints a text, unless standard output belongs to the JSON."""
        if not self._only_json:
            _write(text + "\n")

    def finish(self, numbers: "JsonObject") -> None:
        """Writes the numbers."""
        text = strict_json(numbers, indent=2) + "\n"
        if self._only_json:
            _write(text)
        elif self._path is not None:
            self._path.write_text(text)


def _write(text: str) -> None:
    """Writes to standard output; nobody need read it to the end for files to be written."""
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:
        # What is left in the buffer goes nowhere, instead of raising once more at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def table(head: Sequence[str], rows: Sequence[Sequence[str]], most: int) -> str:
    """Right-aligned columns; of more than `most` rows, the first and last."""
    shown = list(rows)
    if len(shown) > most:
        half = most // 2
        shown = [*shown[:half], ["…"] * len(head), *shown[-half:]]
    widths = [max(len(row[i]) for row in [head, *shown]) for i in range(len(head))]
    lines = [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in [head, *shown]
    ]
    return "\n".join(lines)
