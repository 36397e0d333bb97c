"""`jaxbiped cache`: what is kept on disk for the next process."""

from jaxbiped.caching._disk_cache import BYTES, CACHE_VARIABLE, cache_folder, clear_disk, disk_use
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns, records

_CONTENT = {
    "lanes": "machine code of lanes",
    "programs": "programs of lanes, without their code",
    "host": "programs run by NumPy",
    "sources": "digests of the package's source",
    "xla": "programs compiled by XLA",
}


class Cache(options.Command):
    """Show the compiled programs that are kept on disk, or remove them."""

    clear: bool = False
    """Remove them all: what is run next compiles again."""
    json: options.JsonPath = None
    """File for the same in JSON; - prints only that."""

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        report, folder = Report(self.json), cache_folder()
        removed = clear_disk() if self.clear else None
        use = disk_use()
        rows = [(_CONTENT[kind], each.entries, each.size / 2**20) for kind, each in use.items()]
        layout = {"kept": "{0[0]}", "entries": "{0[1]}", "MiB": "{0[2]:.1f}"}
        report.say(columns(layout, rows))
        if folder is None:
            report.say(f"nothing is kept: {CACHE_VARIABLE} is empty")
        else:
            report.say(f"in {folder}, at most {BYTES // 2**20} MiB")
        if removed is not None:
            report.say(f"removed: {removed.entries} entries, {removed.size / 2**20:.1f} MiB")
        numbers = {"folder": folder and str(folder), "bound_bytes": BYTES}
        kept = {kind: records(each) for kind, each in use.items()}
        report.finish(numbers | {"kept": kept, "removed": records(removed)})
        return 0
