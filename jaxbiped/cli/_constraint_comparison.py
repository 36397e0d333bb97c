"""Comparison of constraint methods: violation, error and time."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import jaxbiped as jb
from jaxbiped._checks import ArgumentError
from jaxbiped._progress import stage
from jaxbiped.cli._declarations import names

if TYPE_CHECKING:
    import numpy as np

ASTRAY = 0.05
"""Error of the state (SI units) from which a run that came to its end has still failed."""
_EXPLICIT = ("bosh3", "tsit5", "dopri5", "dopri8", "euler", "runge2")
"""Solvers whose steps solve no equations: their programs are small, quickly compiled."""
_TRUTH = 1e-10
_MOST_STEPS = 1 << 25
_MOMENT = 1e-6
"""Share of the duration that is simulated to compile a program."""
_LONG = 1.0
"""Time of runs after which none is repeated [s]."""


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
            value = float(number.removeprefix("dt="))
        except ValueError:
            value = -1.0
        if name not in solvers or not value > 0.0:
            raise ArgumentError(
                f"integrator = {text!r} is not allowed: write SOLVER:TOLERANCE or SOLVER:dt=STEP, "
                f"the solver one of {', '.join(solvers)}."
            )
        return Integrator(name, dt=value) if fixed else Integrator(name, rtol=value)

    @property
    def by_lanes(self) -> bool:
        """Whether lanes have it: their programs are made in a seventh of the time of XLA's."""
        import jax

        solver = jb.solvers.SOLVERS[self.solver]()
        able = self.dt is None and isinstance(solver, jb.solvers.AbstractRosenbrock)
        return able and jax.default_backend() == "cpu"

    @property
    def work(self) -> int:
        """About how much a run is, most of it compiling, in units of a timing."""
        if self.by_lanes:
            return 2
        return 3 if self.solver in _EXPLICIT else 12


class ConstraintRun(NamedTuple):
    """One method with one integrator.

    Attributes:
        method: its name.
        integrator: the solver's name.
        rtol_or_dt: tolerance, or step [s] where `fixed`.
        fixed: whether steps have one size.
        ending: in words; "failed" where the state at the end is off by `ASTRAY` or more.
        max_violation_m: largest ‖Φ‖ at the end of a step [m].
        max_violation_rate: largest ‖Φ̇‖ there [m/s].
        state_error: largest difference from the minimal formulation's state at the end (SI units).
        wall_s_run: time of the fastest run, compiled before [s].
        steps: attempted.
        engine: "lanes" or "xla", the one that ran it.
    """

    method: str
    integrator: str
    rtol_or_dt: float
    fixed: bool
    ending: str
    max_violation_m: float
    max_violation_rate: float
    state_error: float
    wall_s_run: float
    steps: int
    engine: str


def compare_constraints(
    scene: "jb.Scene",
    state: Any,
    *,
    duration: float,
    integrators: Sequence[Integrator],
    methods: Sequence[str],
    repeats: int,
    advance: Callable[[int], object] = lambda work: None,
) -> Iterator[ConstraintRun]:
    """Runs every method with every integrator from one start, compiled and timed apart.

    The truth is the minimal formulation's state at the end, at a tolerance of 1e-10. As many
    programs as there are threads are compiled at once; nothing is while a run is timed. Lanes run
    what they can, XLA the rest. Each run is given as it is done, the integrators with the quickest
    programs first, the methods of each together; `advance` is told of the work, an integrator's
    `work` for each run. Of `repeats` runs the fastest counts.
    """
    from concurrent.futures import ThreadPoolExecutor

    from jaxbiped.compiler import default_threads

    with stage("simulating the minimal formulation to compare with"):
        truth = final_truth(scene, state, duration)
    scenes = {
        name: jb.RedundantScene(scene, jb.constraints.CONSTRAINT_METHODS[name]())
        for name in methods
    }
    quick_first = sorted(integrators, key=lambda each: each.work)
    every = [(name, integrator) for integrator in quick_first for name in methods]
    threads = default_threads()
    with ThreadPoolExecutor(threads) as pool:
        for first in range(0, len(every), threads):
            some = every[first : first + threads]
            futures = [
                pool.submit(_compiled, scenes[name], state, duration, integrator)
                for name, integrator in some
            ]
            for (_, integrator), future in zip(some, futures, strict=True):
                future.result()
                advance(integrator.work - 1)
            for (name, integrator), future in zip(some, futures, strict=True):
                yield _run(name, scenes[name], integrator, future.result(), truth, repeats)
                advance(1)


def final_truth(scene: "jb.Scene", state: Any, duration: float) -> "np.ndarray":
    """The minimal formulation's state after a time, at a tolerance of 1e-10; (8,) or (10,)."""
    import numpy as np

    request = jb.Simulation.prepare(
        scene, state, duration=duration, rtol=_TRUTH, save="end", max_solver_steps=_MOST_STEPS
    )
    return np.array(request().final)


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
        solver=integrator.solver,
        rtol=integrator.rtol,
        dt=integrator.dt,
        save="end",
        extremes=jb.dynamics.violation,
        watch=(),  # stops for nothing but a failure
        max_solver_steps=_MOST_STEPS,
        engine="lanes" if integrator.by_lanes else "xla",
    )
    # XLA takes over where the scene holds an operation that lanes lack.
    request = replace(request, replaceable=True)
    moment = as_float(_MOMENT * float(request.duration))
    jax.block_until_ready(replace(request, duration=moment)())
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
    failed = found.outcome == jb.Ending.WALKING and not error < ASTRAY
    return ConstraintRun(
        method=name,
        integrator=integrator.solver,
        rtol_or_dt=float(integrator.dt if integrator.rtol is None else integrator.rtol),  # type: ignore[arg-type]
        fixed=integrator.dt is not None,
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
    while not seconds or (len(seconds) < repeats and sum(seconds) < _LONG):
        begin = time.perf_counter()
        found = jax.block_until_ready(request())
        seconds.append(time.perf_counter() - begin)
    return found, min(seconds)
