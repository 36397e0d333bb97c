"""The options that every experiment takes."""

import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import tyro


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
        if str(self.json) != "-":
            print(text, flush=True)

    def finish(self, numbers: dict[str, Any]) -> None:
        """Writes the numbers where `--json` says."""
        text = json.dumps(numbers, indent=2)
        if str(self.json) == "-":
            sys.stdout.write(text + "\n")
        elif self.json is not None:
            self.json.write_text(text + "\n")


def parse(description: str) -> Options:
    """Options from the command line."""
    return tyro.cli(Options, description=description)
