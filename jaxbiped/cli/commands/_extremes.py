"""`jaxbiped extremes`: simulations at the extremes, held against equations written anew."""

import dataclasses
from pathlib import Path

from jaxbiped.cli._walk_options import OutputOptions


@dataclasses.dataclass(frozen=True)
class Extremes:
    """Run simulations at the extremes, and count how they come out."""

    quick: bool = False
    """A ninth of the cases of one parameter, in under a minute once compiled."""
    out: Path | None = None
    """Folder that keeps the verdicts, from which a later run goes on."""
    json: Path | None = None
    """File for the counts in JSON; - prints only them."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        OutputOptions(out=self.out, json=self.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._extremes import run

        return run(self)
