"""`jaxbiped constraints`: the constraint methods compared on the seed's walk."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import jaxbiped as jb
from jaxbiped.cli import _options as options
from jaxbiped.cli._constraint_comparison import ConstraintRun, Integrator, compare_constraints
from jaxbiped.cli._declarations import names
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._scene_options import SceneOptions, StartOptions, compliant_and_minimal

if TYPE_CHECKING:
    from jaxbiped._types import JsonObject

_COLUMNS = {
    "method": (9, "{0.method}"),
    "integrator": (10, "{0.integrator}"),
    "by": (10, "{1} {0.rtol_or_dt:g}"),
    "ending": (13, "{0.ending}"),
    "max |Phi| m": (11, "{0.max_violation_m:.1e}"),
    "rate m/s": (8, "{0.max_violation_rate:.1e}"),
    "error": (7, "{0.state_error:.1e}"),
    "steps": (7, "{0.steps}"),
    "run s": (6, "{0.wall_s_run:.3f}"),
    "to standard": (11, "{2}"),
}
"""Widths and formats by heads: a row is printed before the others are known."""
_BAR = "{desc} {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"


class Constraints(options.Command):
    """Compare the seven ways to hold the hip together: violation, error against the minimal
    formulation, and time."""

    scene: Annotated[SceneOptions, compliant_and_minimal("compared")]
    start: StartOptions
    methods: Annotated[
        tuple[str, ...], options.one_of("constraints.CONSTRAINT_METHODS")._replace(each=True)
    ] = names("constraints.CONSTRAINT_METHODS")
    """Names of the methods to compare."""
    integrators: Annotated[
        tuple[str, ...], options.Check(lambda _, text: Integrator.read(text), each=True)
    ] = ("rodas4:1e-6", "euler:dt=1e-6", "runge2:dt=1e-6")
    """Each SOLVER:TOLERANCE, or SOLVER:dt=STEP for steps of one size [s]."""
    duration: Annotated[float, options.positive("s")] = 0.5
    """Simulated time [s]."""
    repeats: options.Count = 3
    """Runs of which the fastest counts; none is repeated once they took a second."""
    out: Path | None = None
    """Folder for the picture."""
    json: options.Numbers = None

    def run(self) -> int:
        """Runs the command; returns the exit code, 1 where Ctrl-C ended it."""
        from tqdm import tqdm

        scene = self.scene.scene()
        assert isinstance(scene, jb.Scene)
        integrators = [Integrator.read(text) for text in self.integrators]
        options.make_folder(self.out)
        report, runs = Report(self.json), list[ConstraintRun]()
        many = len(integrators) * len(self.methods)
        work = len(self.methods) * sum(each.work for each in integrators)
        complete = False
        with tqdm(total=work, smoothing=0.0, bar_format=_BAR, desc=f"0/{many} runs") as bar:
            try:
                found = compare_constraints(
                    scene,
                    self.start.state(scene),
                    duration=self.duration,
                    integrators=integrators,
                    methods=self.methods,
                    repeats=self.repeats,
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
        # Times by one engine are not those by the other.
        engines = {run.integrator: f"; {run.integrator} by {run.engine}" for run in runs}
        report.say(
            f"{self.duration:g} s from the start; errors against the minimal formulation at 1e-10"
            + "".join(engines.values())
        )
        numbers: list[JsonObject] = [run._asdict() for run in runs]
        if self.out is not None and runs:
            path = self.out / "constraints.png"
            jb.plot.constraint_runs(numbers).savefig(path)
            report.wrote([path])
        report.finish({"duration_s": self.duration, "complete": complete, "runs": numbers})
        return 0 if complete else 1


def _lines(found: Iterator[ConstraintRun], runs: list[ConstraintRun]) -> Iterator[str]:
    """The table line by line, each as its run is done, which is kept in `runs`."""
    head = [word.rjust(width) for word, (width, _) in _COLUMNS.items()]
    for run in found:
        runs.append(run)
        told = (run, "dt" if run.fixed else "rtol", _to_standard(run, runs))
        row = [text.format(*told) for _, text in _COLUMNS.values()]
        lines = table(head, [row], most=1).splitlines()
        yield "\n".join(lines if len(runs) == 1 else lines[1:])


def _to_standard(run: ConstraintRun, runs: Sequence[ConstraintRun]) -> str:
    """The time in units of the standard method's with the same integrator, if that has run."""
    same = (each for each in runs if each[1:4] == run[1:4] and each.method == "standard")
    return next((f"{run.wall_s_run / each.wall_s_run:.2f}" for each in same), "")
