"""`jaxbiped constraints`: the constraint methods compared on the seed's walk."""

import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from tqdm import tqdm

from jaxbiped._types import JsonObject
from jaxbiped.cli._constraint_comparison import ConstraintRun, compare_constraints, work_of
from jaxbiped.cli._integrator import Integrator
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._walk_options import OutputOptions
from jaxbiped.cli.commands._constraints import Constraints
from jaxbiped.scene._scene import Scene

_HEAD = (
    "method",
    "integrator",
    "by",
    "ending",
    "max |Phi| m",
    "rate m/s",
    "error",
    "steps",
    "run s",
    "to standard",
)
_WIDTHS = (9, 10, 10, 13, 11, 8, 7, 7, 6, 11)
"""Of the columns: a row is printed before the others are known."""
_BAR = "{desc} {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"


def run(options: Constraints) -> int:
    """Runs the command; returns the exit code, 1 where Ctrl-C ended it."""
    scene = options.scene.scene()
    assert isinstance(scene, Scene)
    integrators = [Integrator.read(text) for text in options.integrators]
    OutputOptions(out=options.out, json=options.json).check()
    report, runs = Report(options.json), list[ConstraintRun]()
    many = len(integrators) * len(options.methods)
    work = len(options.methods) * sum(map(work_of, integrators))
    complete = False
    with tqdm(total=work, smoothing=0.0, bar_format=_BAR, desc=f"0/{many} runs") as bar:
        try:
            found = compare_constraints(
                scene,
                options.start.state(scene),
                duration=options.duration,
                integrators=integrators,
                methods=options.methods,
                repeats=options.repeats,
                advance=bar.update,
            )
            for line in _lines(found, runs):
                with bar.external_write_mode(file=sys.stdout):
                    report.say(line)
                bar.set_description_str(f"{len(runs)}/{many} runs")
            complete = True
        except KeyboardInterrupt:
            pass
    if not complete:
        report.say(f"stopped by Ctrl-C after {len(runs)} of {many} runs")
    report.say(
        f"{options.duration:g} s from the start; errors against the minimal formulation at 1e-10"
        f"{_engines(runs)}"
    )
    numbers = run_numbers(runs)
    if options.out is not None and runs:
        report.say(f"wrote {write_picture(numbers, options.out)}")
    report.finish({"duration_s": options.duration, "complete": complete, "runs": numbers})
    return 0 if complete else 1


def write_picture(runs: list[JsonObject], out: Path) -> Path:
    """Writes the comparison as a picture; returns its path."""
    from jaxbiped import plot

    path = out / "constraints.png"
    plot.constraint_runs(runs).savefig(path)
    return path


def run_numbers(runs: list[ConstraintRun]) -> list[JsonObject]:
    """Runs ready for JSON: None for what is not a finite number."""
    return [
        {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in run._asdict().items()
        }
        for run in runs
    ]


def _lines(found: Iterator[ConstraintRun], runs: list[ConstraintRun]) -> Iterator[str]:
    """The table line by line, each as its run is done, which is kept in `runs`."""
    for run in found:
        first = not runs
        runs.append(run)
        lines = _padded(_row(run, _usual(run, runs))).splitlines()
        yield "\n".join(lines if first else lines[1:])


def _engines(runs: Sequence[ConstraintRun]) -> str:
    """Which engine ran what: times by one are not those by the other."""
    used = {run.integrator: run.engine for run in runs}
    return "".join(f"; {integrator} by {engine}" for integrator, engine in used.items())


def _usual(run: ConstraintRun, runs: Sequence[ConstraintRun]) -> float | None:
    """The time of the standard method's run with the same integrator, None for none so far."""
    same = (each for each in runs if each[1:4] == run[1:4] and each.method == "standard")
    return next((each.wall_s_run for each in same), None)


def _row(run: ConstraintRun, usual: float | None) -> tuple[str, ...]:
    return (
        run.method,
        run.integrator,
        f"{'dt ' if run.fixed else 'rtol '}{run.rtol_or_dt:g}",
        run.ending,
        f"{run.max_violation_m:.1e}",
        f"{run.max_violation_rate:.1e}",
        f"{run.state_error:.1e}",
        str(run.steps),
        f"{run.wall_s_run:.3f}",
        "" if usual is None else f"{run.wall_s_run / usual:.2f}",
    )


def _padded(row: tuple[str, ...]) -> str:
    """Head and row, in columns as wide as those of every other row."""
    head = [word.rjust(width) for word, width in zip(_HEAD, _WIDTHS, strict=True)]
    return table(head, [row], most=1)
