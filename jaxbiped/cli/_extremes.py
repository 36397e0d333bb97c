"""`jaxbiped extremes`: simulations at the extremes, held against equations written anew."""

import dataclasses
from pathlib import Path

from jaxbiped._progress import stage
from jaxbiped.cli._report import Report, table
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

    def run(self) -> int:
        """Runs the command; returns the exit code, 1 where something is silently wrong."""
        OutputOptions(out=self.out, json=self.json).check()
        store = None if self.out is None else self.out / "extremes.jsonl"
        with stage("compiling"):
            from jaxbiped import extremes
        rows = extremes.study(extremes.catalogue(quick=self.quick), extremes.judge, store=store)
        groups = extremes.by_group(rows, extremes.VERDICTS)
        total = extremes.counts(rows, extremes.VERDICTS)
        report, head = Report(self.json), ("about", *total)
        shown = {**groups, "all": total}
        lines = [(name, *map(str, counted.values())) for name, counted in shown.items()]
        report.say(table(head, lines, most=len(lines)))
        for verdict in ("flagged", "refused", "silently_wrong", "unresolved"):
            for reason, times in extremes.reasons(rows, verdict).items():
                report.say(f"{verdict}, {times}: {reason}")
        report.finish({**total, "groups": groups})
        return 1 if total["silently_wrong"] else 0
