"""Lane backend of simulations: when lanes can do what is asked, and how they do it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import Array, ArrayLike, PyTree

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._types import as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import LaneEngine, Request
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._state import State
from jaxbiped.solve._adaptive_program import Solve, Solved
from jaxbiped.solve._engine_names import ENGINES, engine_for
from jaxbiped.solve._lane_solve import (
    Setting,
    lane_engine,
    request_of,
    solve_scene,
    solve_step_by_step,
)
from jaxbiped.solve._saved_outputs import Saved
from jaxbiped.solve._trajectory import Trajectory, arrivals_among, single_time
from jaxbiped.solve.controllers._first_and_last_step import just_before_end
from jaxbiped.solve.controllers._footstep_counter import PATIENCE
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock

if TYPE_CHECKING:
    from jaxbiped.simulate._simulation import Simulation

_QUICK = 100_000
"""Attempted steps that take less than a second."""


def choose_engine(
    engine: str,
    *,
    solver: diffrax.AbstractSolver[PyTree],
    save_steps: bool,
    adjoint: diffrax.AbstractAdjoint | None,
    leaves: PyTree,
    times: str | ArrayLike | AbstractSection,
    section: AbstractSection | None,
    dt: ArrayLike | None = None,
    redundant: bool = False,
) -> str:
    """The engine that "auto" stands for, or the one that is asked for.

    Raises:
        ArgumentError: an unknown name, or lanes or CUDA for what they cannot do.
    """
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jtu.tree_leaves(leaves))
    obstacle = _hindrance(solver, save_steps, adjoint, leaves, times, traced=traced)
    if redundant and not (isinstance(times, str) and times == "end"):
        obstacle = 'redundant coordinates are diffrax\'s, but for save="end"'
    if dt is not None:
        obstacle = "steps of one size (dt) are diffrax's"
    if section is None:
        return engine_for(engine, obstacle=obstacle, prefers_xla=redundant, by_device=True)
    check_choice("engine", engine, ENGINES)
    if engine == "xla" or obstacle is not None:
        why = f"here {obstacle}" if obstacle is not None else 'engine = "xla" was chosen'
        raise ArgumentError(
            f"save = {type(section).__name__}() is not allowed here: only lanes do that, and {why}."
        )
    return engine_for("cuda", obstacle=None, by_device=True) if engine == "cuda" else "lanes"


def _hindrance(
    solver: diffrax.AbstractSolver[PyTree],
    save_steps: bool,
    adjoint: diffrax.AbstractAdjoint | None,
    leaves: PyTree,
    times: str | ArrayLike | AbstractSection,
    *,
    traced: bool,
) -> str | None:
    """Why lanes cannot do what is asked."""
    if not isinstance(solver, AbstractRosenbrock):
        return f"{type(solver).__name__} is not one of its solvers (rodas3p to rodas5p)"
    if save_steps and traced:
        return 'under jit, vmap or derivatives it does not save every step (save="steps")'
    if adjoint is not None:
        return "an adjoint is diffrax's"
    if isinstance(times, jax.core.Tracer):
        return "the times to save at must be known beforehand"
    if isinstance(times, AbstractSection) and jtu.tree_leaves(times):
        return f"the section {type(times).__name__} holds numbers of its own"
    if any(jnp.result_type(leaf) != jnp.float64 for leaf in jtu.tree_leaves(leaves)):
        return "it computes in 64 bits"
    return None


def by_lanes(run: "Simulation", request: Request | None = None) -> Trajectory:
    """Runs a request; see `simulate`. What it asks of lanes may be known, see `lane_request`."""
    dense, arrivals, setting = None, None, _setting(run)
    solve: Solve = (lane_request(run) if request is None else request).inputs
    if run.save_steps:
        ended, t, state, dense = _step_by_step(run, solve, setting)
    elif not setting.saved.within:
        ended, _ = solve_scene(solve, setting)
        t, state = single_time(ended.t, ended.state)
    else:
        times = None if run.times is None else np.asarray(run.times)
        room = 0 if run.section is None else run.max_arrivals
        ended, recorded = solve_scene(solve, setting, times=times, room=room)
        assert recorded is not None
        # As diffrax has it: infinite where the solve ended before.
        saved = arrivals_among(recorded.values, jnp.asarray(recorded.counts), run.state)
        t, state = saved.t, saved.state
        if run.section is not None:
            arrivals, (t, state) = saved, single_time(ended.t, ended.state)
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
    """What a request asks of lanes."""
    return request_of(_solve(run), _setting(run))


def able_request(run: "Simulation") -> Request | None:
    """What is asked of lanes; None where XLA runs it, also for what they lack by "auto"."""
    if run.engine == "xla":
        return None
    request = lane_request(run)
    hindered = run.replaceable and _engine(run).can(request) is not None
    return None if hindered else request


def prepare_lanes(run: "Simulation", request: Request) -> Callable[["Simulation"], Trajectory]:
    """`by_lanes`, with all compiled that it needs for one simulation.

    Where only the end is asked for, what JAX does around it is compiled as well.
    """
    _engine(run).compile(request).prepare(1)
    return by_lanes if _setting(run).saved.within else _compiled


_compiled = cached_jit(by_lanes)


def _step_by_step(
    run: "Simulation", solve: Solve, setting: Setting
) -> tuple[Solved, Array, State, diffrax.DenseInterpolation]:
    ended, rows = solve_step_by_step(solve, setting, most=run.max_solver_steps)
    ended = jax.device_put(ended)
    return ended, *recorded_steps(run.state, rows, setting.solver)


def _engine(run: "Simulation") -> LaneEngine:
    return lane_engine(device=run.engine == "cuda")


def _setting(run: "Simulation") -> Setting:
    assert isinstance(run.solver, AbstractRosenbrock)
    quick = run.max_solver_steps <= _QUICK
    saved = Saved(
        steps=run.save_steps,
        times=run.times is not None,
        section=run.section,
        extremes=run.extremes,
    )
    return Setting(
        run.solver, run.watch, run.footsteps is not None, quick, saved, device=run.engine == "cuda"
    )


def _solve(run: "Simulation") -> Solve:
    footsteps = 0 if run.footsteps is None else run.footsteps
    return Solve(
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
