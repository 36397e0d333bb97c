"""`jaxbiped extremes`: simulations at the extremes, held against equations written anew."""

from jaxbiped._progress import stage
from jaxbiped.cli._report import Report, table
from jaxbiped.cli.commands._extremes import Extremes


def run(options: Extremes) -> int:
    """Runs the command; returns the exit code, 1 where something is silently wrong."""
    store = None if options.out is None else options.out / "extremes.jsonl"
    with stage("compiling"):
        from jaxbiped import extremes
    rows = extremes.study(extremes.catalogue(quick=options.quick), extremes.judge, store=store)
    groups = extremes.by_group(rows, extremes.VERDICTS)
    total = extremes.counts(rows, extremes.VERDICTS)
    report, head = Report(options.json), ("about", *total)
    shown = {**groups, "all": total}
    lines = [(name, *map(str, counted.values())) for name, counted in shown.items()]
    report.say(table(head, lines, most=len(lines)))
    for verdict in ("flagged", "refused", "silently_wrong", "unresolved"):
        for reason, times in extremes.reasons(rows, verdict).items():
            report.say(f"{verdict}, {times}: {reason}")
    report.finish({**total, "groups": groups})
    return 1 if total["silently_wrong"] else 0
