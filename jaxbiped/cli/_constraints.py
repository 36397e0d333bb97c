"""`jaxbiped constraints`: the constraint methods compared: violation, error and time."""

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import jaxbiped as jb
from jaxbiped._checks import ArgumentError
from jaxbiped._progress import stage
from jaxbiped._quantity import si_number
from jaxbiped.cli import _options as options
from jaxbiped.cli._declarations import names
from jaxbiped.cli._report import Report, csv_of, table
from jaxbiped.cli._scene_options import SceneOptions, compliant_and_minimal
from jaxbiped.cli._start_options import StartOptions

if TYPE_CHECKING:
    import numpy as np

_ASTRAY = 0.05
"""Error of the state (SI units) from which a run that came to its end has still failed."""
# Their steps solve no equations, so that their programs are small and soon compiled.
_EXPLICIT = ("bosh3", "tsit5", "dopri5", "dopri8", "euler", "runge2")
_MOST_STEPS = 1 << 25
_COLUMNS = {
    "method": (9, "{0.method}"),
    "integrator": (10, "{0.integrator}"),
    "by": (10, "{1}"),
    "ending": (13, "{0.ending}"),
    "max |Phi| m": (11, "{0.max_violation_m:.1e}"),
    "rate m/s": (8, "{0.max_violation_rate:.1e}"),
    "error": (7, "{0.state_error:.1e}"),
    "steps": (7, "{0.steps}"),
    "run s": (6, "{0.wall_s_run:.3f}"),
    "to standard": (11, "{2}"),
}
"""Widths and formats by heads: a row is printed before the others are known."""


class Integrator(NamedTuple):
    """How to integrate: a solver's name, and its relative tolerance or its step [s]."""

    solver: str
    rtol: float | None = None
    dt: float | None = None

    @staticmethod
    def read(text: str) -> "Integrator":
        """From `rodas4:1e-6` (a tolerance) or `euler:dt=1e-6` (a step [s])."""
        solvers = names("solvers.SOLVERS")
        name, _, number = text.partition(":")
        fixed = number.startswith("dt=")
        try:
            value = si_number(number.removeprefix("dt="), "s" if fixed else "")
        except ValueError:
            value = -1.0
        if name not in solvers or not value > 0.0:
            raise ArgumentError(
                f"integrator = {text!r} is not allowed: write SOLVER:TOLERANCE or SOLVER:dt=STEP, "
                f"the solver one of {', '.join(solvers)}."
            )
        return Integrator(name, dt=value) if fixed else Integrator(name, rtol=value)


class ConstraintRun(NamedTuple):
    """One method with one integrator.

    Attributes:
        method: its name.
        integrator: the solver's name.
        rtol: relative tolerance; None for steps of one size.
        dt_s: size of the steps [s]; None for adaptive ones.
        ending: in words; "failed" where the state at the end is off by 0.05 or more.
        max_violation_m: largest ‖Φ‖ at the end of a step [m].
        max_violation_rate: largest ‖Φ̇‖ there [m/s].
        state_error: largest difference from the minimal formulation's state at the end (SI units).
        wall_s_run: time of the fastest run, compiled before [s].
        steps: attempted.
        engine: "lanes" or "xla", the one that ran it.
    """

    method: str
    integrator: str
    rtol: float | None
    dt_s: float | None
    ending: str
    max_violation_m: float
    max_violation_rate: float
    state_error: float
    wall_s_run: float
    steps: int
    engine: str


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
    """Integrators to compare: SOLVER:TOLERANCE, or SOLVER:dt=STEP for a fixed step size [s]."""
    duration: Annotated[float, options.positive("s")] = 0.5
    """Simulated time [s]."""
    repeats: options.Count = 3
    """Number of runs, of which the fastest counts; none is repeated after a second in all."""
    output: options.OutputOptions

    def run(self) -> int:
        """Runs the command; returns the exit code, or passes Ctrl-C on behind the rows so far."""
        scene = self.scene.scene()
        assert isinstance(scene, jb.Scene)
        integrators = [Integrator.read(text) for text in self.integrators]
        self.output.make_folder()
        report, runs = Report(self.output.json, self.output.csv), list[ConstraintRun]()
        many = len(integrators) * len(self.methods)
        comparing = stage("comparing", total=many, unit="runs")
        with comparing as now, contextlib.suppress(KeyboardInterrupt):  # what is done is reported
            for run in compare_constraints(
                scene,
                self.start.start(scene, self.scene.walker),
                duration=self.duration,
                integrators=integrators,
                methods=self.methods,
                repeats=self.repeats,
            ):
                runs.append(run)
                now.clear()
                report.say(_line(runs))
                now.update()
        complete = len(runs) == many
        # Times by one engine are not those by the other.
        engines = {run.integrator: f"; {run.integrator} ({run.engine})" for run in runs}
        report.say(
            f"{self.duration:g} s from the start; errors against the minimal formulation at 1e-10"
            + "".join(engines.values())
        )
        numbers = [run._asdict() for run in runs]
        report.finish(
            {"duration_s": self.duration, "complete": complete, "runs": numbers},
            lambda: csv_of(numbers),
        )
        if runs:
            draw = {"constraints": lambda: jb.plot.constraint_runs(numbers)}
            report.wrote(self.output.draw(draw))
        if not complete:
            raise options.interrupted(f"{len(runs)} of {many} runs are done")
        return 0


def _line(runs: Sequence[ConstraintRun]) -> str:
    """The last run's line of the table; the first one's with the head."""
    run = runs[-1]
    # In units of the standard method's with the same integrator, if that has run.
    same = (each for each in runs if each[1:4] == run[1:4] and each.method == "standard")
    share = next((f"{run.wall_s_run / each.wall_s_run:.2f}" for each in same), "")
    by = f"rtol {run.rtol:g}" if run.dt_s is None else f"dt {run.dt_s:g}"
    row = [text.format(run, by, share) for _, text in _COLUMNS.values()]
    head = [word.rjust(width) for word, (width, _) in _COLUMNS.items()]
    return table(head, [row], most=1).split("\n", int(len(runs) > 1))[-1]


def compare_constraints(
    scene: "jb.Scene",
    state: Any,
    *,
    duration: float,
    integrators: Sequence[Integrator],
    methods: Sequence[str],
    repeats: int,
) -> Iterator[ConstraintRun]:
    """Runs every method with every integrator from one start, compiled and timed apart.

    The truth is the minimal formulation's state at the end, at a tolerance of 1e-10. As many
    programs as there are threads are compiled at once; nothing is while a run is timed. Each run is
    given as it is done, the integrators with the quickest programs first, the methods of each
    together. Of `repeats` runs the fastest counts.
    """
    from concurrent.futures import ThreadPoolExecutor

    from jaxbiped.compiler import default_threads

    with stage("simulating the minimal formulation to compare with"):
        truth = final_truth(scene, state, duration)
    quick_first = sorted(integrators, key=lambda each: each.solver not in _EXPLICIT)
    every = [
        (name, jb.RedundantScene(scene, jb.constraints.CONSTRAINT_METHODS[name]()), integrator)
        for integrator in quick_first
        for name in methods
    ]
    threads = default_threads()
    with ThreadPoolExecutor(threads) as pool:
        for first in range(0, len(every), threads):
            some = every[first : first + threads]
            compiled = list(
                pool.map(lambda each: _compiled(each[1], state, duration, each[2]), some)
            )
            for each, request in zip(some, compiled, strict=True):
                yield _run(*each, request, truth, repeats)


def final_truth(scene: "jb.Scene", state: Any, duration: float) -> "np.ndarray":
    """The minimal formulation's state after a time, at a tolerance of 1e-10; (8,) or (10,)."""
    import numpy as np

    how = dict(duration=duration, rtol=1e-10, save="end", max_solver_steps=_MOST_STEPS)
    return np.array(jb.simulate(scene, state, **how).final)  # type: ignore[arg-type]


def _compiled(
    scene: "jb.RedundantScene", state: Any, duration: float, integrator: Integrator
) -> "jb.Simulation":
    """The request, whose program is compiled: another duration, tolerance or step runs the same."""
    import jax

    from jaxbiped._types import as_float

    request = jb.Simulation.prepare(
        scene,
        state,
        duration=duration,
        **integrator._asdict(),
        save="end",
        extremes=jb.dynamics.violation,
        watch=(),  # stops for nothing but a failure
        max_solver_steps=_MOST_STEPS,
    )
    moment = dataclasses.replace(request, duration=as_float(1e-6 * duration))
    jax.block_until_ready(moment())
    return request


def _run(
    name: str,
    scene: "jb.RedundantScene",
    integrator: Integrator,
    request: "jb.Simulation",
    truth: "np.ndarray",
    repeats: int,
) -> ConstraintRun:
    import numpy as np

    found, seconds = time_run(request, repeats)
    final = np.array(jb.dynamics.minimal_state(scene, found.final))
    error = float(np.max(np.abs(final - truth)))
    failed = found.outcome == jb.Ending.WALKING and not error < _ASTRAY
    return ConstraintRun(
        method=name,
        integrator=integrator.solver,
        rtol=integrator.rtol,
        dt_s=integrator.dt,
        ending="failed" if failed else str(found.outcome),
        max_violation_m=float(found.highest.position),
        max_violation_rate=float(found.highest.rate),
        state_error=error,
        wall_s_run=seconds,
        steps=int(found.attempted),
        engine=found.engine,
    )


def time_run(request: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """What a compiled request gives, and the time of its fastest run [s]."""
    import jax

    seconds: list[float] = []
    while not seconds or (len(seconds) < repeats and sum(seconds) < 1.0):
        begin = time.perf_counter()
        found = jax.block_until_ready(request())
        seconds.append(time.perf_counter() - begin)
    return found, min(seconds)
