"""Simulation by lanes, or by what runs their programs on devices."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxbiped._types import as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import LaneEngine, Request
from jaxbiped.dynamics._state import State
from jaxbiped.simulate._recorded_steps import recorded_steps
from jaxbiped.solve._adaptive_program import Solve, Solved
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
