"""Variational solves by lanes, compiled and called."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._types import Scalar
from jaxbiped.compiler import CompiledProgram, Recording, call, call_recording
from jaxbiped.solve._final_step import just_before_end
from jaxbiped.solve._units import Units, units_of
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._solve_to_section import Precision
from jaxbiped.variational._switch_locator import Watch
from jaxbiped.variational._tangents import Seeded, Tangents
from jaxbiped.variational._variational_program import AdaptiveColumns
from jaxbiped.variational._variational_types import VariationalProblem, VariationalSolution

_QUICK = 50_000
"""Attempted steps that take less than a second."""


def solve_variational(
    watch: Watch,
    solver: AbstractRosenbrock,
    y0: Tangents,
    args: Seeded,
    sizes: Scalar,
    *,
    precision: Precision,
    time_limit: Any,
    max_solver_steps: int,
    carries_parameters: Any = True,
    save_nodes: bool = False,
) -> tuple[VariationalSolution, Recording | None]:
    """Solves from `y0` to the section, a failure or `time_limit` [s].

    Of the columns the last p move one parameter each, by `sizes`, shape (p,), in the order of the
    active leaves; the columns before move none. Unless `carries_parameters`, the last p are not
    carried, and NaN in the end. Seeds are not looked at. Records are the time and the state at the
    ends of the accepted steps.
    """
    m = y0.columns.shape[1] - len(args.active)
    inputs = VariationalProblem(
        args=args.args,
        state=y0.state,
        by_state=y0.columns[:, :m].T,
        by_parameter=y0.columns[:, m:].T,
        sizes=sizes,
        carries_parameters=_number(carries_parameters),
        state_floors=args.floors[:m],
        parameter_floors=args.floors[m:],
        rtol=_number(precision.rtol),
        tangent_rtol=_number(precision.tangent_rtol),
        units=jtu.tree_map(_number, units_of(args.args, y0.state)),
        time_limit=_number(time_limit),
        almost=just_before_end(_number(time_limit)),
        most_attempts=_number(max_solver_steps),
    )
    structures = (jtu.tree_structure(args.args), jtu.tree_structure(y0.state))
    compiled = _compiled(watch, solver, args.active, m, save_nodes, *structures)
    quick = max_solver_steps <= _QUICK
    if save_nodes:
        room = max_solver_steps
        return call_recording(compiled, inputs, room=room, quick=quick)
    return call(compiled, inputs, quick=quick)[0], None


@functools.lru_cache(maxsize=256)
def _compiled(
    watch: Watch,
    solver: AbstractRosenbrock,
    active: tuple[int, ...],
    directions: int,
    save_nodes: bool,
    args: Any,
    state: Any,
) -> CompiledProgram:
    """The program for arguments and states of these structures, and m directions of state."""
    c, p = state.num_leaves, len(active)

    def numbers(*shape: int) -> Any:
        return jax.ShapeDtypeStruct(shape, jnp.float64)

    shapes = VariationalProblem(
        jtu.tree_unflatten(args, [numbers()] * args.num_leaves),
        jtu.tree_unflatten(state, [numbers()] * c),
        numbers(directions, c),
        numbers(p, c),
        numbers(p),
        numbers(),
        numbers(directions),
        numbers(p),
        rtol=numbers(),
        tangent_rtol=numbers(),
        units=Units(jtu.tree_unflatten(state, [numbers()] * c), numbers()),
        time_limit=numbers(),
        almost=numbers(),
        most_attempts=numbers(),
    )
    body = AdaptiveColumns(solver, watch, active, save_nodes=save_nodes)
    return CompiledProgram(body.program(), shapes)


def _number(value: Any) -> Scalar:
    return jnp.asarray(value, dtype=jnp.float64)
