"""The options that every experiment takes."""

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import tyro
from matplotlib.figure import Figure

from jaxbiped.cli import Report


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of an experiment."""

    out: Path = Path("out")
    """Folder for pictures and tables."""
    json: Path | None = None
    """File for the numbers in SI units; - prints only them."""
    quick: bool = False
    """A small version, in under a minute."""

    def path(self, name: str) -> Path:
        """Where to write a file of this name."""
        self.out.mkdir(parents=True, exist_ok=True)
        return self.out / name

    def save(self, figure: Figure, name: str) -> str:
        """Writes a picture of this name and lets go of the figure; returns where it is."""
        path = self.path(name)
        figure.savefig(path, dpi=150)
        plt.close(figure)
        return str(path)

    def say(self, text: str = "") -> None:
        """Prints for people, unless standard output belongs to the JSON."""
        Report(self.json).say(text)

    def table(self, rows: Iterable[Any], **formats: str) -> None:
        """Prints a line for each row: the entries named, as their formats write them.

        Rows are mappings or named tuples; a dash stands for None.
        """
        named = [row if isinstance(row, Mapping) else row._asdict() for row in rows]
        lines = [
            list(formats),
            *([_cell(row.get(name), form) for name, form in formats.items()] for row in named),
        ]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        for line in lines:
            cells = (cell.rjust(width) for cell, width in zip(line, widths, strict=True))
            self.say("  ".join(cells))

    def finish(self, numbers: dict[str, Any]) -> None:
        """Writes the numbers where `--json` says."""
        Report(self.json).finish(numbers)


def by(key: str, rows: Iterable[Mapping[str, Any]]) -> dict[Any, list[Any]]:
    """Rows by the value of an entry, in the order in which values come first."""
    found: dict[Any, list[Any]] = {}
    for row in rows:
        found.setdefault(row[key], []).append(row)
    return found


def _cell(value: Any, form: str) -> str:
    return "–" if value is None else format(value, form)


def parse(description: str) -> Options:
    """Options from the command line."""
    return tyro.cli(Options, description=description)
