"""Simulations run by the lane engine."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.dynamics._state import State
from jaxbiped.lanes._adaptive import Solve
from jaxbiped.lanes._end_of_solve import almost
from jaxbiped.lanes._solve import Setting, compiled_solve, solved, solved_at
from jaxbiped.solve._footstep_limit import PATIENCE
from jaxbiped.solve._rosenbrock import AbstractRosenbrock
from jaxbiped.solve._trajectory import Trajectory

if TYPE_CHECKING:
    from jaxbiped.simulate._simulate import Simulation


_QUICK = 100_000
"""Attempted steps that take less than a second."""


def by_lanes(run: "Simulation") -> Trajectory:
    """Runs a request; see `simulate`."""
    if run.times is None:
        ended = solved(_solve(run), _setting(run))
        t = jnp.reshape(ended.t, (1,))
        state = jtu.tree_map(lambda leaf: jnp.reshape(leaf, (1,)), ended.state)
    else:
        ended, recorded = solved_at(_solve(run), _setting(run), np.asarray(run.times))
        # As diffrax has it: infinite where the solve ended before.
        reached = jnp.arange(recorded.values.shape[0]) < recorded.counts
        values = jnp.where(reached[:, None], recorded.values, jnp.inf)
        t, state = values[:, 0], State(*[values[:, 1 + i] for i in range(len(State._fields))])
    return Trajectory(
        t=t,
        state=state,
        ending=ended.ending,
        accepted=ended.accepted,
        rejected=ended.rejected,
        dense=None,
        engine="lanes",
    )


def prepared_lanes(run: "Simulation") -> Callable[["Simulation"], Trajectory]:
    """`by_lanes`, with all compiled that it needs for one simulation.

    Where only the end is asked for, what JAX does around it is compiled as well.
    """
    structure = jtu.tree_structure(run.scene)
    compiled_solve(_setting(run), structure, dense=run.times is not None).code(1)
    return _compiled if run.times is None else by_lanes


_compiled = eqx.filter_jit(by_lanes)


def _setting(run: "Simulation") -> Setting:
    assert isinstance(run.solver, AbstractRosenbrock)
    quick = run.max_solver_steps <= _QUICK
    return Setting(run.solver, run.watch, run.steps is not None, quick)


def _solve(run: "Simulation") -> Solve:
    def number(value: Any) -> Scalar:
        return jnp.asarray(value, dtype=jnp.float64)

    footsteps = 0 if run.steps is None else run.steps
    return Solve(
        scene=run.scene,
        state=run.state,
        duration=run.duration,
        almost=almost(run.duration),
        rtol=run.rtol,
        atol=run.atol,
        footsteps=number(footsteps),
        patience=number(PATIENCE * footsteps),
        most_attempts=number(run.max_solver_steps),
    )
