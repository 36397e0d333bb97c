"""`jaxbiped constraints`: the constraint methods compared on the seed's walk."""

import dataclasses
import math
from pathlib import Path

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive
from jaxbiped._types import JsonObject
from jaxbiped.cli._constraint_comparison import ConstraintRun, Integrator, compare_constraints
from jaxbiped.cli._option_fields import Group, group
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._walk_options import OutputOptions, SceneOptions, StartOptions
from jaxbiped.constraints._constraint_methods import CONSTRAINT_METHODS
from jaxbiped.scene._scene import Scene

_MOST_ROWS = 200


@dataclasses.dataclass(frozen=True)
class Constraints:
    """Compare the seven ways to hold the hip together: violation, error against the minimal
    formulation, and time."""

    scene: Group[SceneOptions] = group(SceneOptions)
    start: Group[StartOptions] = group(StartOptions)
    methods: tuple[str, ...] = tuple(CONSTRAINT_METHODS)
    """Names of the methods to compare."""
    integrators: tuple[str, ...] = ("rodas4:1e-6", "euler:dt=1e-6", "runge2:dt=1e-6")
    """Each SOLVER:TOLERANCE, or SOLVER:dt=STEP for steps of one size [s]."""
    duration: float = 0.5
    """Simulated time [s]."""
    repeats: int = 3
    """Runs of which the fastest counts."""
    out: Path | None = None
    """Folder for the picture."""
    json: Path | None = None
    """File for the numbers in SI units; - prints only them."""

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        scene = self.scene.scene()
        if not isinstance(scene, Scene):
            raise ArgumentError(
                "model or formulation is not allowed here: compliant and minimal are compared."
            )
        for name in self.methods:
            check_choice("methods", name, CONSTRAINT_METHODS)
        check_positive("duration", self.duration, "s")
        check_count("repeats", self.repeats)
        integrators = [Integrator.read(text) for text in self.integrators]
        OutputOptions(out=self.out, json=self.json).check()
        runs = compare_constraints(
            scene,
            self.start.state(scene),
            duration=self.duration,
            integrators=integrators,
            methods=self.methods,
            repeats=self.repeats,
            progress=True,
        )
        report = Report(self.json)
        report.say(run_table(runs))
        report.say(
            f"{self.duration:g} s from the start; errors against the minimal formulation at 1e-10"
        )
        numbers = run_numbers(runs)
        if self.out is not None:
            report.say(f"wrote {write_picture(numbers, self.out)}")
        report.finish({"duration_s": self.duration, "runs": numbers})
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
