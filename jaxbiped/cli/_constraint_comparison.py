"""Comparison of constraint methods: violation, error and time."""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np

from jaxbiped._ending import Ending
from jaxbiped._progress import stage
from jaxbiped._types import as_float
from jaxbiped.cli._integrator import Integrator
from jaxbiped.compiler import default_threads
from jaxbiped.constraints._constraint_methods import method_named
from jaxbiped.dynamics._redundant_motion import violation
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._state import WalkerState
from jaxbiped.scene._scene import RedundantScene, Scene
from jaxbiped.simulate._simulation import Simulation
from jaxbiped.solve._solvers import solver_named
from jaxbiped.solve._trajectory import Trajectory
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

ASTRAY = 0.05
"""Error of the state (SI units) from which a run that came to its end has still failed."""
_TRUTH = 1e-10
_MOST_STEPS = 1 << 25
_MOMENT = 1e-6
"""Share of the duration that is simulated to compile a program."""
_LONG = 1.0
"""Time of runs after which none is repeated [s]."""


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
    scene: Scene,
    state: WalkerState,
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
    what they can, XLA the rest.

    Args:
        scene: what to simulate.
        state: start, a `State`.
        duration: simulated time [s].
        integrators: how to integrate.
        methods: some of `CONSTRAINT_METHODS`.
        repeats: runs of which the fastest counts; none is repeated once they took a second.
        advance: is told of work that is done, `work_of` an integrator for each run.

    Yields:
        A `ConstraintRun` for every pair of method and integrator as it is done, the integrators
        with the quickest programs first, the methods of each together.
    """
    with stage("simulating the minimal formulation to compare with"):
        truth = final_truth(scene, state, duration)
    scenes = {name: RedundantScene(scene, method_named(name)) for name in methods}
    quick_first = sorted(integrators, key=work_of)
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
                advance(work_of(integrator) - 1)
            for (name, integrator), future in zip(some, futures, strict=True):
                yield _run(name, scenes[name], integrator, future.result(), truth, repeats)
                advance(1)


def work_of(integrator: Integrator) -> int:
    """About how much work one of its runs is, most of it compiling, in units of a timing."""
    if by_lanes(integrator):
        return 2
    return 3 if integrator.explicit else 12


def by_lanes(integrator: Integrator) -> bool:
    """Whether lanes have it: their programs are made in a seventh of the time of XLA's."""
    solver = solver_named(integrator.solver)
    able = integrator.dt is None and isinstance(solver, AbstractRosenbrock)
    return able and jax.default_backend() == "cpu"


def final_truth(scene: Scene, state: WalkerState, duration: float) -> np.ndarray:
    """The minimal formulation's state after a time, at a tolerance of 1e-10; (8,) or (10,)."""
    request = Simulation.prepare(
        scene, state, duration=duration, rtol=_TRUTH, save="end", max_solver_steps=_MOST_STEPS
    )
    return np.array(request().final)


def _compiled(
    scene: RedundantScene, state: WalkerState, duration: float, integrator: Integrator
) -> Simulation:
    """The request, whose program is compiled: another duration, tolerance or step runs the same."""
    request = Simulation.prepare(
        scene,
        state,
        duration=duration,
        solver=integrator.solver,
        rtol=integrator.rtol,
        dt=integrator.dt,
        save="end",
        extremes=violation,
        watch=(),  # stops for nothing but a failure
        max_solver_steps=_MOST_STEPS,
        engine="lanes" if by_lanes(integrator) else "xla",
    )
    # XLA takes over where the scene holds an operation that lanes lack.
    request = replace(request, replaceable=True)
    moment = as_float(_MOMENT * float(request.duration))
    jax.block_until_ready(replace(request, duration=moment)())
    return request


def _run(
    name: str,
    scene: RedundantScene,
    integrator: Integrator,
    request: Simulation,
    truth: np.ndarray,
    repeats: int,
) -> ConstraintRun:
    found, seconds = time_run(request, repeats)
    final = np.array(minimal_state(scene, found.final))
    error = float(np.max(np.abs(final - truth)))
    outcome = found.outcome
    stood = outcome == Ending.WALKING and error < ASTRAY
    return ConstraintRun(
        method=name,
        integrator=integrator.solver,
        rtol_or_dt=float(integrator.dt if integrator.rtol is None else integrator.rtol),  # type: ignore[arg-type]
        fixed=integrator.dt is not None,
        ending=str(outcome) if stood or outcome != Ending.WALKING else "failed",
        max_violation_m=float(found.highest.position),
        max_violation_rate=float(found.highest.rate),
        state_error=error,
        wall_s_run=seconds,
        steps=int(found.attempted),
        engine=found.engine,
    )


def time_run(request: Simulation, repeats: int) -> tuple[Trajectory, float]:
    """What a compiled request gives, and the time of its fastest run [s]."""
    seconds: list[float] = []
    while not seconds or (len(seconds) < repeats and sum(seconds) < _LONG):
        begin = time.perf_counter()
        found = jax.block_until_ready(request())
        seconds.append(time.perf_counter() - begin)
    return found, min(seconds)
