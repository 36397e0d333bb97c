"""`jaxbiped models`: what can be modelled, and what it costs."""

import dataclasses
from pathlib import Path

from jaxbiped.cli._walk_options import OutputOptions


@dataclasses.dataclass(frozen=True)
class Models:
    """List the laws of contact and the ladder of models, with parameters, units and cost."""

    json: Path | None = None
    """File for the same in JSON; - prints only that."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        OutputOptions(json=self.json).check()

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped.cli._models import run

        return run(self)
