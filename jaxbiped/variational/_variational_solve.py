"""Variational solves by lanes: for a time, or to a section."""

from typing import cast

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import LANES, XLA, AbstractEngine, Program, Recorded, Recording, Request
from jaxbiped.solve._units import units_of
from jaxbiped.solve.controllers._first_and_last_step import just_before_end
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._solve_to_section import Nodes, SectionArrival
from jaxbiped.variational._tangents import (
    SectionSolve,
    Seeded,
    Tangents,
    VariationalProblem,
    VariationalSolution,
    Watch,
)
from jaxbiped.variational._variational_program import AdaptiveColumns

_QUICK = 50_000
"""Attempted steps that take less than a second."""


def solve_variational(
    how: SectionSolve,
    y0: Tangents,
    args: Seeded,
    sizes: Scalar,
    *,
    carries_parameters: Scalar | bool = True,
    save_nodes: bool = False,
    engine: AbstractEngine | None = LANES,
) -> tuple[VariationalSolution, Recording | Recorded | None]:
    """Solves from `y0` by a program, which either engine runs.

    Of the columns the last p move one parameter each, by `sizes`, shape (p,), in the order of the
    active leaves; the columns before move none. Unless `carries_parameters`, the last p are not
    carried, and NaN in the end. Seeds are not looked at. Records are the time and the state at the
    ends of the accepted steps. Without an engine it is lanes where they can, else XLA.
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
        rtol=_number(how.precision.rtol),
        tangent_rtol=_number(how.precision.tangent_rtol),
        units=jtu.tree_map(_number, units_of(args.args, y0.state)),
        max_time=_number(how.max_time),
        almost=just_before_end(_number(how.max_time)),
        max_attempts=_number(how.max_solver_steps),
    )
    request = Request(
        _program(how.watch, cast(AbstractRosenbrock, how.solver), args.active, save_nodes),
        inputs,
        room=how.max_solver_steps if save_nodes else 0,
        quick=how.max_solver_steps <= _QUICK,
        keeps_records=save_nodes,
    )
    if engine is None:
        engine = XLA if LANES.can(request) else LANES
    found = engine.run(request)
    return found.outputs, found.recording


@bounded_cache(PROGRAMS)  # the same object each time, so that nothing is compiled again
def _program(
    watch: Watch, solver: AbstractRosenbrock, active: tuple[int, ...], save_nodes: bool
) -> Program:
    return AdaptiveColumns(solver, watch, active, save_nodes=save_nodes).program()


def _number(value: RealScalarLike) -> Scalar:
    return jnp.asarray(value, dtype=jnp.float64)


def solve_to_section_by_lanes(
    how: SectionSolve, y0: Tangents, args: Seeded, sizes: Scalar, carries_parameters: Scalar | bool
) -> SectionArrival:
    """`solve_to_section` for columns as `solve_variational` takes them; nodes are a `Recording`."""
    found, recording = solve_variational(
        how, y0, args, sizes, carries_parameters=carries_parameters, save_nodes=True
    )
    return SectionArrival(
        y=Tangents(found.state, found.columns.T),
        time=found.t,
        time_columns=found.time_columns,
        code=found.code,
        peak=found.peak,
        peak_columns=found.peak_columns,
        jumps=found.jumps,
        missed=jnp.asarray(False),  # its columns meet at every switch
        grazes=found.grazes,
        attempted=found.attempted,
        nodes=None if recording is None else _nodes(y0.state, found, recording),
    )


def _nodes(start: PyTree, found: VariationalSolution, recording: Recording | Recorded) -> Nodes:
    first = jnp.stack([jnp.zeros(()), *jtu.tree_leaves(start)])
    last = jnp.stack([found.t, *jtu.tree_leaves(found.state)])
    return Nodes(first, recording, last, found.accepted)
