"""The options that every experiment takes."""

import dataclasses
from pathlib import Path
from typing import Any

import tyro

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

    def say(self, text: str = "") -> None:
        """Prints for people, unless standard output belongs to the JSON."""
        Report(self.json).say(text)

    def finish(self, numbers: dict[str, Any]) -> None:
        """Writes the numbers where `--json` says."""
        Report(self.json).finish(numbers)


def parse(description: str) -> Options:
    """Options from the command line."""
    return tyro.cli(Options, description=description)
