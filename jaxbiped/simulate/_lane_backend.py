"""Lane backend of simulations: when lanes can do what is asked, and how they do it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._types import as_float, is_traced
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import BY_NAME, LaneEngine, Request
from jaxbiped.scene._state_types import State
from jaxbiped.simulate._start import Options
from jaxbiped.solve._adaptive_program import AdaptiveSolve, Solve, Solved, adaptive_program
from jaxbiped.solve._engine_names import ENGINES, engine_for
from jaxbiped.solve._saved_outputs import Saved
from jaxbiped.solve._trajectory import Trajectory, arrivals_among, single_time
from jaxbiped.solve.controllers._event_steps import PATIENCE
from jaxbiped.solve.controllers._wrapped_control import just_before_end
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

if TYPE_CHECKING:
    from jaxbiped.simulate._simulation import Simulation

_QUICK = 100_000
"""Attempted steps that take less than a second."""
_ROOM = 1 << 18
"""Steps that there is room for at first; who takes more runs again, with room for as many."""


def choose_engine(
    asked: Options, solver: diffrax.AbstractSolver[PyTree], leaves: PyTree, *, redundant: bool
) -> str:
    """The engine that "auto" stands for, or the one that is asked for.

    Raises:
        ArgumentError: an unknown name, or lanes or CUDA for what they cannot do.
    """
    obstacle = _hindrance(asked, solver, leaves)
    if redundant and not (isinstance(asked.save, str) and asked.save == "end"):
        obstacle = 'redundant coordinates are diffrax\'s, but for save="end"'
    if asked.dt is not None:
        obstacle = "steps of one size (dt) are diffrax's"
    engine, section = asked.engine, asked.section
    if section is None:
        return engine_for(engine, obstacle=obstacle, prefers_xla=redundant, by_device=True)
    check_choice("engine", engine, ENGINES)
    if engine == "xla" or obstacle is not None:
        chosen = 'engine = "xla" was chosen; choose "lanes" or "auto"'
        why = f"here {obstacle}" if obstacle is not None else chosen
        raise ArgumentError(
            f"save = {type(section).__name__}() is not allowed here: only lanes do that, and {why}."
        )
    return engine_for("cuda", obstacle=None, by_device=True) if engine == "cuda" else "lanes"


def _hindrance(
    asked: Options, solver: diffrax.AbstractSolver[PyTree], leaves: PyTree
) -> str | None:
    """Why lanes cannot do what is asked."""
    each, section = jtu.tree_leaves(leaves), asked.section
    if not isinstance(solver, AbstractRosenbrock):
        return f"{type(solver).__name__} is not one of its solvers (rodas3p to rodas5p)"
    if asked.save_steps and is_traced(each):
        return (
            'under jit, vmap or derivatives it does not save every step (save="steps"); ask for '
            'save="end", an array of times or a section'
        )
    if asked.adjoint is not None:
        return "an adjoint is diffrax's"
    if isinstance(asked.times, jax.core.Tracer):
        return "the times to save at must be known beforehand"
    if section is not None and jtu.tree_leaves(section):
        return f"the section {type(section).__name__} holds numbers of its own"
    if any(jnp.result_type(leaf) != jnp.float64 for leaf in each):
        return "it computes in 64 bits"
    return None


def by_lanes(run: "Simulation", request: Request | None = None) -> Trajectory:
    """Runs a request; see `simulate`. What it asks of lanes may be known, see `lane_request`."""
    request = lane_request(run) if request is None else request
    dense, arrivals = None, None
    if run.save_steps:
        ended, rows = _step_by_step(run, request)
        t, state, dense = recorded_steps(run.state, rows, _rosenbrock(run))
    else:
        times = None if run.times is None else np.asarray(run.times)
        room = 0 if run.section is None else run.max_arrivals
        found = BY_NAME[run.engine].run(request._replace(times=times, room=room))
        ended, recorded = found.outputs, found.records
        t, state = single_time(ended.t, ended.state)
        if recorded is not None:
            # As diffrax has it: infinite where the solve ended before.
            saved = arrivals_among(recorded.values, jnp.asarray(recorded.counts), run.state)
            if run.section is None:
                t, state = saved.t, saved.state
            else:
                arrivals = saved
    return Trajectory(
        t=t,
        state=state,
        ending=ended.ending,
        accepted=ended.accepted,
        rejected=ended.rejected,
        dense=dense,
        arrivals=arrivals,
        lowest=ended.lowest,
        highest=ended.highest,
        correction=run.correction,
        engine=run.engine,
    )


def lane_request(run: "Simulation") -> Request:
    """What a request asks of lanes, which may hold no operation that it needs."""
    footsteps = 0 if run.footsteps is None else run.footsteps
    solve = Solve(
        scene=run.scene,
        state=run.state,
        duration=run.duration,
        almost=just_before_end(run.duration),
        rtol=run.rtol,
        atol=run.atol,
        units=run.units,
        footsteps=as_float(footsteps),
        patience=as_float(PATIENCE * footsteps),
        max_attempts=as_float(run.max_solver_steps),
    )
    saved = Saved(run.save_steps, run.times is not None, run.section, run.extremes)
    steps = AdaptiveSolve(
        _rosenbrock(run), run.watch, run.footsteps is not None, saved, located=True
    )
    return Request(adaptive_program(steps), solve, quick=run.max_solver_steps <= _QUICK)


def prepare_lanes(run: "Simulation", request: Request) -> Callable[["Simulation"], Trajectory]:
    """`by_lanes`, with all compiled that it needs for one simulation.

    Where only the end is asked for, what JAX does around it is compiled as well.
    """
    engine = BY_NAME[run.engine]
    assert isinstance(engine, LaneEngine)
    engine.compile(request).prepare(1)
    within = run.save_steps or run.times is not None or run.section is not None
    return by_lanes if within else _compiled


_compiled = cached_jit(by_lanes)


def _rosenbrock(run: "Simulation") -> AbstractRosenbrock:
    assert isinstance(run.solver, AbstractRosenbrock)
    return run.solver


def _step_by_step(run: "Simulation", request: Request) -> tuple[Solved, np.ndarray]:
    """One simulation, not traced, and the records of its steps, (n, numbers)."""
    one = jtu.tree_map(lambda leaf: np.asarray(leaf)[None], request.inputs)
    room = min(run.max_solver_steps, _ROOM)
    while True:
        asked = request._replace(inputs=one, room=room, batch=True)
        outputs, recorded, _ = BY_NAME[run.engine].run(asked)
        assert recorded is not None
        steps = int(recorded.counts[0])
        if steps <= room:
            ended = jax.device_put(jtu.tree_map(lambda leaf: leaf[0], outputs))
            return ended, recorded.values[0, :steps]
        # Memory is asked for by what a solve takes, not by what it might.
        room = steps


class RecordedSteps(NamedTuple):
    """The times [s] of a start and of n steps' ends, (n + 1,), the states there, and the rest."""

    t: Array
    state: State
    dense: diffrax.DenseInterpolation


def recorded_steps(start: State, rows: np.ndarray, solver: AbstractRosenbrock) -> RecordedSteps:
    """From the records of `Saved(steps=True)`, shape (n, numbers), as diffrax would have them."""
    kind: Callable[..., State] = type(start)
    size = len(start)
    first = np.array([0.0, *(float(leaf) for leaf in start)])
    ends = np.vstack([first, rows[:, : 1 + size]]).T.copy()
    # One step more than there are: where there are none, diffrax looks into one all the same.
    times = np.append(ends[0], np.inf)
    infos = np.vstack([ends[1:, :-1], rows[:, 1:].T])
    infos = np.pad(infos, ((0, 0), (0, 1)), constant_values=np.inf)
    groups = [kind(*infos[k : k + size]) for k in range(0, len(infos), size)]
    # One transfer for all of them: each costs as much as several steps.
    counts = len(rows) + 1, 1  # of a weak type, as a number in diffrax's own would be
    parts = times, groups, ends[0], kind(*ends[1:]), np.float64(0.0), counts
    times, groups, t, states, zero, (count, one) = jax.device_put(parts)
    dense = diffrax.DenseInterpolation(
        ts=times,
        ts_size=count,
        infos=dict(y0=groups[0], y1=groups[1], coefficients=tuple(groups[2:])),
        interpolation_cls=solver.interpolation_cls,
        direction=one,
        t0_if_trivial=zero,
        y0_if_trivial=start,
    )
    return RecordedSteps(t, states, dense)
