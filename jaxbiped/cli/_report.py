"""Reports for people and for programs."""

import csv
import enum
import io
import math
import os
import string
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxbiped._files import JsonObject, strict_json
from jaxbiped.caching import IMPORT_BEGAN


class Report:
    """Prints for people, and writes the same numbers for programs: by `--json` and `--csv`."""

    def __init__(self, json_path: Path | None, csv_path: Path | None = None) -> None:
        self._json, self._csv = json_path, csv_path
        self._is_quiet = "-" in (str(json_path), str(csv_path))

    def say(self, *lines: str) -> None:
        """Prints lines, one that is empty where none is given, unless a program reads them."""
        if not self._is_quiet:
            _write("\n".join(lines) + "\n")

    def wrote(self, paths: Iterable[Path]) -> None:
        for path in paths:
            self.say(f"wrote {path}")

    def finish(self, numbers: JsonObject, rows: Callable[[], str] | None = None) -> None:
        """Writes the table, whose text `rows` makes, and the numbers."""
        if rows is not None:
            _write_to(self._csv, rows)
        _write_to(self._json, lambda: strict_json(numbers, indent=2) + "\n")


def _write_to(path: Path | None, text: Callable[[], str]) -> None:
    if str(path) == "-":
        _write(text())
    elif path is not None:
        path.write_text(text())


def csv_of(rows: Iterable[Mapping[str, Any]]) -> str:
    """Rows of numbers as comma-separated values, under their names; those within as NAME.inner."""
    text = io.StringIO()
    known = [
        {
            f"{name}.{inner}" if inner else name: number
            for name, value in each.items()
            for inner, number in (value if isinstance(value, Mapping) else {"": value}).items()
        }
        for each in rows
    ]
    names = dict.fromkeys(name for each in known for name in each)
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(known)
    return text.getvalue()


def _write(text: str) -> None:
    """Writes to standard output; nobody need read it to the end for files to be written."""
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:
        # What is left in the buffer goes nowhere, instead of raising once more at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def wall_times(imported: float) -> dict[str, float]:
    """How long the import took, which ended at `imported`, and all until now [s]."""
    return {"import": imported - IMPORT_BEGAN, "total": time.perf_counter() - IMPORT_BEGAN}


def records(result: Any) -> Any:
    """A result as dictionaries by the names of its fields, and enumerations in words."""
    if hasattr(result, "_asdict"):
        return {name: records(each) for name, each in result._asdict().items()}
    if isinstance(result, list | tuple):
        return [records(each) for each in result]
    return str(result) if isinstance(result, enum.Enum) else result


class _Words(string.Formatter):
    """Formats, and has a word for what is not known."""

    def format_field(self, value: Any, format_spec: str) -> Any:
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            return "unknown"
        return super().format_field(value, format_spec)


def words(text: str, thing: object) -> str:
    """A text with what it asks of a thing, `{0.name:.3f}` or `{0[name]:.3f}`.

    None and what is not finite are unknown.
    """
    return _Words().format(text, thing)


def columns(layout: Mapping[str, str], things: Iterable[object], most: int = 64) -> str:
    """A table with a row for each thing: `layout` has the format of each column by its head."""
    rows = [[words(text, each) for text in layout.values()] for each in things]
    return table(list(layout), rows, most)


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
