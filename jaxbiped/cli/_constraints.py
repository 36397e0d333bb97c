"""`jaxbiped constraints`: the constraint methods compared on the seed's walk."""

import math
from pathlib import Path

from jaxbiped._types import JsonObject
from jaxbiped.cli._constraint_comparison import ConstraintRun, compare_constraints
from jaxbiped.cli._integrator import Integrator
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._walk_options import OutputOptions
from jaxbiped.cli.commands._constraints import Constraints
from jaxbiped.scene._scene import Scene

_MOST_ROWS = 200


def run(options: Constraints) -> int:
    """Runs the command; returns the exit code."""
    scene = options.scene.scene()
    assert isinstance(scene, Scene)
    integrators = [Integrator.read(text) for text in options.integrators]
    OutputOptions(out=options.out, json=options.json).check()
    runs = compare_constraints(
        scene,
        options.start.state(scene),
        duration=options.duration,
        integrators=integrators,
        methods=options.methods,
        repeats=options.repeats,
        progress=True,
    )
    report = Report(options.json)
    report.say(run_table(runs))
    report.say(
        f"{options.duration:g} s from the start; errors against the minimal formulation at 1e-10"
    )
    numbers = run_numbers(runs)
    if options.out is not None:
        report.say(f"wrote {write_picture(numbers, options.out)}")
    report.finish({"duration_s": options.duration, "runs": numbers})
    return 0


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


def run_table(runs: list[ConstraintRun]) -> str:
    """Runs as a table; times also relative to the standard method's with the same integrator."""
    usual = {
        (run.integrator, run.rtol_or_dt): run.wall_s_run for run in runs if run.method == "standard"
    }
    rows = []
    for run in runs:
        base = usual.get((run.integrator, run.rtol_or_dt))
        rows.append(
            (
                run.method,
                run.integrator,
                f"{'dt ' if run.fixed else 'rtol '}{run.rtol_or_dt:g}",
                run.ending,
                f"{run.max_violation_m:.1e}",
                f"{run.max_violation_rate:.1e}",
                f"{run.state_error:.1e}",
                str(run.steps),
                f"{run.wall_s_run:.3f}",
                "" if base is None else f"{run.wall_s_run / base:.2f}",
            )
        )
    head = (
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
    return table(head, rows, most=_MOST_ROWS)
