"""`jaxbiped cache`: what is kept on disk for the next process."""

import dataclasses
from pathlib import Path

from jaxbiped._files import check_writable_file
from jaxbiped.caching._disk_cache import BYTES, CACHE_VARIABLE, cache_folder, clear_disk, disk_use
from jaxbiped.cli._report import Report, table

_CONTENT = {
    "lanes": "machine code of lanes",
    "programs": "programs of lanes, without their code",
    "host": "programs run by NumPy",
    "sources": "digests of the package's source",
    "xla": "programs compiled by XLA",
}


@dataclasses.dataclass(frozen=True)
class Cache:
    """Show the compiled programs that are kept on disk, or remove them."""

    clear: bool = False
    """Remove them all: what is run next compiles again."""
    json: Path | None = None
    """File for the same in JSON; - prints only that."""

    def check(self) -> None:
        """Raises `ArgumentError` for what is wrong in itself, before anything slow is imported."""
        if self.json is not None and str(self.json) != "-":
            check_writable_file("--json", self.json)

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        report, folder = Report(self.json), cache_folder()
        removed = clear_disk() if self.clear else None
        use = disk_use()
        rows = [
            (_CONTENT[kind], str(each.entries), f"{each.size / 2**20:.1f}")
            for kind, each in use.items()
        ]
        report.say(table(("kept", "entries", "MiB"), rows, most=len(rows)))
        if folder is None:
            report.say(f"nothing is kept: {CACHE_VARIABLE} is empty")
        else:
            report.say(f"in {folder}, at most {BYTES // 2**20} MiB")
        if removed is not None:
            report.say(f"removed: {removed.entries} entries, {removed.size / 2**20:.1f} MiB")
        report.finish(
            {
                "folder": None if folder is None else str(folder),
                "bound_bytes": BYTES,
                "kept": {kind: each._asdict() for kind, each in use.items()},
                "removed": None if removed is None else removed._asdict(),
            }
        )
        return 0
