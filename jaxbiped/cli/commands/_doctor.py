"""`jaxbiped doctor`: what is installed and whether it computes rightly, for reports of bugs."""

import dataclasses
from pathlib import Path

from jaxbiped._files import check_writable_file


@dataclasses.dataclass(frozen=True)
class Doctor:
    """Show versions, vectors, threads and caches, and test this machine's answers."""

    json: Path | None = None
    """File for the same in JSON; - prints only that."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        if self.json is not None and str(self.json) != "-":
            check_writable_file("--json", self.json)

    def run(self) -> int:
        """Runs the command; returns the exit code: 1 where something is wrong."""
        from jaxbiped.cli._doctor import examine

        return examine(self)
