"""Variational solves by programs: to a section, to given times, and the events there.

Derivatives of a motion are with respect to its start and its scene.
"""

from collections.abc import Callable
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, select
from jaxbiped.caching._caches import PROGRAMS, bounded_cache
from jaxbiped.compiler import LANES, XLA, AbstractEngine, Program, Recorded, Recording, Request
from jaxbiped.hybrid._scales import units_of
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._watch import Watch
from jaxbiped.solve.controllers._wrapped_control import just_before_end
from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.variational._solve_to_section import Nodes, SectionArrival
from jaxbiped.variational._tangents import (
    SectionSolve,
    Seeded,
    Tangents,
    VariationalProblem,
    VariationalSolution,
    along_columns,
    as_columns,
)
from jaxbiped.variational._variational_program import AdaptiveColumns

_QUICK = 50_000
"""Attempted steps that take less than a second."""
_FLOOR = 1e-4
"""Size below which a derivative's error is absolute, along a direction of its own size."""
_LOOSER = 10.0
"""Tolerance of derivatives, in units of the state's."""
_MOST_ATTEMPTS = 1_000_000
_NEAR = 1e-3
"""Time from the event, in units of time, beyond which it is not known where that lies."""


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
    how: SectionSolve,
    y0: Tangents,
    args: Seeded,
    sizes: Scalar,
    carries_parameters: Scalar | bool,
    engine: AbstractEngine,
) -> SectionArrival:
    """`solve_to_section` for columns as `solve_variational` takes them; nodes are a `Recording`.

    State and columns are those behind the watch's `arrival`.
    """
    found, recording = solve_variational(
        how,
        y0,
        args,
        sizes,
        carries_parameters=carries_parameters,
        save_nodes=True,
        engine=engine,
    )
    start = how.watch.node(args.args, y0.state)
    return SectionArrival(
        y=Tangents(found.state, found.columns.T),
        time=found.t,
        time_columns=found.time_columns,
        code=found.code,
        peak=found.peak,
        peak_columns=found.peak_columns,
        jumps=found.jumps,
        grazes=found.grazes,
        attempted=found.attempted,
        nodes=None if recording is None else _nodes(start, found, recording),
    )


def _nodes(start: PyTree, found: VariationalSolution, recording: Recording | Recorded) -> Nodes:
    first = jnp.stack([jnp.zeros(()), *jtu.tree_leaves(start)])
    last = jnp.stack([found.t, *jtu.tree_leaves(found.reached)])
    return Nodes(first, recording, last, found.accepted)


class TangentsAtTimes(NamedTuple):
    """States at k times, and their derivatives in n directions.

    Attributes:
        state: leaves of shape (k,).
        columns: of the c leaves, shape (k, n, c); NaN from where they are not determined.
    """

    state: PyTree
    columns: Scalar


def tangents_at_times(
    how: SectionSolve,
    start: Tangents,
    seeded: Seeded,
    times: Scalar,
    engine: AbstractEngine | None = None,
) -> TangentsAtTimes:
    """Follows a motion from one time to the next, with its derivatives.

    Times increase; infinite ones are passed over.
    """

    def follow(
        now: tuple[Scalar, Tangents], time: Scalar
    ) -> tuple[tuple[Scalar, Tangents], TangentsAtTimes]:
        since, at = now
        moves = jnp.isfinite(time) & (time > since)
        lasts = jnp.where(moves, time - since, 0.0)
        found = tangents_after(how, at, seeded, lasts, engine)
        after = select(moves, found, at)
        return (jnp.where(moves, time, since), after), TangentsAtTimes(after.state, after.columns.T)

    first = (jnp.zeros_like(times[0]), start)
    if len(times) == 1:
        _, found = follow(first, times[0])
        return jtu.tree_map(lambda leaf: leaf[None], found)
    return jax.lax.scan(follow, first, times)[1]


def motion_solve(watch: Watch, solver: AbstractRosenbrock, rtol: RealScalarLike) -> SectionSolve:
    """How a motion solved at this relative tolerance is followed again, with derivatives."""
    return SectionSolve(watch, solver, Precision(rtol, _LOOSER * rtol), jnp.inf, _MOST_ATTEMPTS)


def seeded_directions(
    scene: PyTree, state: PyTree, places: tuple[int, ...], active: tuple[int, ...]
) -> tuple[Tangents, Seeded]:
    """A start and a scene with what moves them: leaves of the state at `places`, then `active` ones
    of the scene.
    """
    c, m, p = len(jtu.tree_leaves(state)), len(places), len(active)
    start = np.zeros((c, m + p))
    start[list(places), range(m)] = 1.0
    leaves = jtu.tree_leaves(scene)
    sizes = [jnp.where(leaves[i] == 0.0, 1.0, jnp.abs(leaves[i])) for i in active]
    inverse = jtu.tree_leaves(units_of(scene, state).inverse)
    floors = [*(jnp.asarray(_FLOOR * inverse[i]) for i in places), *(_FLOOR / s for s in sizes)]
    seeds = jnp.concatenate([jnp.zeros((p, m)), jnp.eye(p)], axis=1)
    return Tangents(state, jnp.asarray(start)), Seeded(
        scene, seeds, jnp.stack(floors) if floors else jnp.zeros(0), active
    )


def tangents_after(
    how: SectionSolve,
    at: Tangents,
    seeded: Seeded,
    time: Scalar,
    engine: AbstractEngine | None = None,
) -> Tangents:
    """A state and its derivatives a fixed time [s] later; NaN where they are not determined."""
    timed, sizes = how._replace(max_time=time), jnp.ones(len(seeded.active))
    found, _ = solve_variational(timed, at, seeded, sizes, engine=engine)
    return Tangents(found.state, jnp.where(found.undetermined, jnp.nan, found.columns.T))


class EventMotion(NamedTuple):
    """An event near a state, and how it moves in n directions.

    Attributes:
        delay: from the state to the event [s].
        time, state: derivatives of its time, shape (n,), and of the state at it, (n, c).
        reached: the state at it.
    """

    delay: Scalar
    time: Scalar
    state: Scalar
    reached: PyTree


def follow_event(
    surface: Callable[[PyTree, PyTree], Scalar],
    field: Callable[[PyTree, PyTree], PyTree],
    at: Tangents,
    args: Seeded,
    *,
    rtol: RealScalarLike,
    unit: RealScalarLike,
) -> EventMotion:
    """Derivatives of an event's time and of the state at it.

    By the implicit function theorem: where g(y(t, p), p) = 0, dt = −(g' dy + g_p dp)/ġ, and the
    state at the event moves by dy + f dt. NaN where the event is not near, or where it grazes: the
    surface's rate is so small that an error of the state makes it turn back.

    Args:
        surface: g of (args, state), zero at the event.
        field: f of (args, state).
        at: the state there, and its columns at a fixed time.
        args: the arguments, and their seeds.
        rtol: relative error that the state may have.
        unit: of time [s].
    """

    def value(y: PyTree, a: PyTree) -> Scalar:
        return surface(a, y)

    def rate(y: PyTree) -> Scalar:
        return jax.jvp(lambda s: surface(args.args, s), (y,), (field(args.args, y),))[1]

    here, along = along_columns(value, at, args)
    velocity = field(args.args, at.state)
    speed, turning = jax.jvp(rate, (at.state,), (velocity,))
    normal = jax.grad(lambda y: surface(args.args, y))(at.state)
    sizes = jtu.tree_map(lambda n, y: jnp.abs(n * y), normal, at.state)
    known_to = rtol * sum(jtu.tree_leaves(sizes))
    grazes = speed * speed <= 2.0 * jnp.abs(turning) * known_to
    is_near = jnp.abs(here) <= _NEAR * unit * jnp.abs(speed)
    time = jnp.where(grazes | ~is_near, jnp.nan, -along / speed)
    state = at.columns.T + time[:, None] * as_columns(velocity)[None]
    delay = -here / speed
    reached = jtu.tree_map(lambda leaf, rate: leaf + rate * delay, at.state, velocity)
    return EventMotion(delay, time, state, reached)
