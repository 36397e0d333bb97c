"""Multiple shooting: a cycle in segments of equal duration, with the derivatives of each of them.

Nothing looks for the section: a segment lasts as long as it is asked to, and whether the cycle
closes and ends on the section is left to equations. All segments are lanes of one solve.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler import XLA, Recorded, host_jit
from jaxbiped.dynamics._walker_motion import WalkerMotion
from jaxbiped.gait._poincare_map import recurring_indices, state_with
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.hybrid._motion_costs import Extreme
from jaxbiped.optimise._augmented_system import motion_of
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._watch import Watch
from jaxbiped.variational._first_adjoint import Row, pull_back_row
from jaxbiped.variational._flow import Flow
from jaxbiped.variational._solve_to_section import Nodes
from jaxbiped.variational._tangents import (
    SectionSolve,
    Seeded,
    Tangents,
    along_columns,
    with_active,
)
from jaxbiped.variational._variational_solve import (
    seeded_directions,
    tangents_after,
    tangents_at_times,
)


class Linearised(NamedTuple):
    """Values of r functions of a segment's end, with their derivatives.

    Attributes:
        values: shape (…, r).
        slopes: with respect to the m recurring components of the segment's start, its duration and
            the k parameters, in this order, shape (…, r, m + 1 + k).
    """

    values: Any
    slopes: Any


class Segments(NamedTuple):
    """Cycles in n segments, linearised; all shapes begin with (b,) for b cycles.

    Attributes:
        ends: recurring components where each segment ends, shape (n, m); the last ones behind the
            reset.
        gains: what the d cyclic coordinates gained until then, shape (n, d).
        arrival: the section's value at the end of the last segment, and its rate [1/s], shape (2,).
        path: functions along the cycle, of the start of each segment itself and of the end of the
            last just before the reset, shape (n + 1, r).
    """

    ends: Linearised
    gains: Linearised
    arrival: Linearised
    path: Linearised


class SegmentWeights(NamedTuple):
    """Derivatives of a function of the segments of one cycle with respect to `Segments`' values.

    Attributes:
        ends, arrival, path: of the same shapes, without that of b cycles.
        gains: the same for every segment, shape (d,).
    """

    ends: Any
    gains: Any
    arrival: Any
    path: Any


@host_jit(runs_by_lanes)
def linearise_segments(
    spec: ReturnMapSpec,
    scene: PyTree,
    like: PyTree,
    cycles: tuple[Scalar, Scalar, Scalar],
    active: tuple[int, ...],
    path: tuple[Extreme, ...],
    precision: Precision,
) -> Segments:
    """Follows the segments of b cycles; derivatives that are not determined are NaN.

    Args:
        spec: whose cycles they are, and how they are solved; `precision` how exactly.
        scene: the arguments but for the active parameters.
        like: a state of the system.
        cycles: of each its starts, shape (b, n, m), the duration of its segments [s], shape (b,),
            and its parameters, shape (b, k).
        active: places of these among the leaves of the scene.
        path: extremes whose functions are told at nodes.
    """
    system, places = spec.system, tuple(recurring_indices(spec.system, like))
    m, p = len(places), len(active)
    seeds = jnp.concatenate([jnp.zeros((p, m + 1)), jnp.eye(p)], axis=1)

    def one(starts: Scalar, duration: Scalar, values: Scalar) -> Segments:
        seeded = Seeded(scene, seeds, jnp.zeros(m + 1 + p), active)
        args = with_active(seeded, list(values))
        seeded = Seeded(args, seeds, seeded.floors, active)
        watch = Watch.of(system, resets=False)
        how = SectionSolve(watch, spec.solver, precision, duration, spec.max_solver_steps)

        def follow(start: Scalar) -> tuple[Tangents, Tangents]:
            """A segment's start and its end, whose columns are those of `Linearised`."""
            state = state_with(system, like, start)
            at, directions = seeded_directions(args, state, places, active)
            end = tangents_after(how, at, directions, duration, spec.programs)
            rates = system.vector_field(jnp.zeros(()), end.state, args)
            rate = jnp.stack(jtu.tree_leaves(rates))
            return _with_duration(at, 0.0 * rate, m), _with_duration(end, rate, m)

        def linearise(function: Callable[[PyTree, PyTree], Scalar], at: Tangents) -> Linearised:
            values, slopes = along_columns(function, at, seeded)
            return Linearised(values, slopes.T)

        begins, ends = jax.vmap(follow)(starts)
        last = jtu.tree_map(lambda leaf: leaf[-1], ends)
        whole = jax.vmap(functools.partial(linearise, _components))(ends)
        behind = linearise(lambda y, a: _components(system.reset_map(a, y), a), last)
        whole = jtu.tree_map(lambda every, one: every.at[-1].set(one), whole, behind)
        arrival = linearise(functools.partial(_arrival, spec), last)
        nodes = jtu.tree_map(lambda e, one: jnp.concatenate([e, one[None]]), begins, last)
        along = jax.vmap(functools.partial(linearise, functools.partial(_along, path)))(nodes)
        return Segments(
            _rows(whole, places), _rows(whole, system.cyclic_coordinates), arrival, along
        )

    return jax.vmap(one)(*cycles)


@host_jit(runs_by_lanes)
def pull_back_segments(
    spec: ReturnMapSpec,
    scene: PyTree,
    like: PyTree,
    cycle: tuple[Scalar, Scalar],
    weights: SegmentWeights,
    active: tuple[int, ...],
    path: tuple[Extreme, ...],
    precision: Precision,
    steps: int,
) -> tuple[Scalar, Scalar]:
    """Carries derivatives of a function of segments backwards in time along each of them.

    Args:
        spec, scene, like, active, path, precision: as of `linearise_segments`.
        cycle: starts, shape (n, m), and the duration of the segments [s].
        weights: the function's derivatives.
        steps: how many equal parts of each segment there are.

    Returns:
        States where these begin, shape (n, steps, c); and derivatives of the Hamiltonian, the
        costate times the rates, with respect to the k parameters there, shape (n, steps, k).
    """
    system, (starts, duration) = spec.system, cycle
    structure, c = jtu.tree_structure(like), len(jtu.tree_leaves(like))
    where = jnp.asarray([*recurring_indices(system, like), *system.cyclic_coordinates])
    watch = Watch.of(system, resets=False)
    how = SectionSolve(watch, spec.solver, precision, duration, spec.max_solver_steps)
    still = Seeded(scene, jnp.zeros((0, 0)), jnp.zeros(0), ())
    section = functools.partial(system.arrival, spec.section)
    seeded = Seeded(scene, jnp.zeros((0, 0)), jnp.zeros(0), active)
    flow = Flow(system, section, system.vector_field, seeded, structure)
    times = duration * jnp.arange(1, steps + 1) / steps

    def function_of_end(y: PyTree, ends: Scalar, is_last: Scalar) -> Scalar:
        row = jnp.concatenate([ends, weights.gains])
        arrived = row @ _components(system.reset_map(scene, y), scene)[where]
        arrived += weights.arrival @ _arrival(spec, y, scene)
        arrived += weights.path[-1] @ _along(path, y, scene)
        return jnp.where(is_last, arrived, row @ _components(y, scene)[where])

    def follow(start: Scalar, ends: Scalar, is_last: Scalar) -> tuple[Scalar, Scalar]:
        state = state_with(system, like, start)
        at = Tangents(state, jnp.zeros((c, 0)))
        states = tangents_at_times(how, at, still, times, spec.programs).state
        rows, count = jnp.stack([times, *jtu.tree_leaves(states)], axis=-1), jnp.asarray(steps)
        end = jtu.tree_map(lambda leaf: leaf[-1], states)
        row = _components(jax.grad(function_of_end)(end, ends, is_last), scene)
        first = jnp.concatenate([jnp.zeros(1), _components(state, scene)])
        nodes = Nodes(first, Recorded(rows, count), rows[-1], count)  # type: ignore[arg-type]
        behind = Row(row, jnp.zeros(len(active)))
        _, along = pull_back_row(spec.programs or XLA, flow, nodes, behind)
        known = jnp.asarray(along.values)[::-1]
        return known[:, 1 : 1 + c], known[:, 1 + 2 * c :]

    return jax.vmap(follow)(starts, weights.ends, jnp.arange(len(starts)) == len(starts) - 1)


def _with_duration(at: Tangents, rate: Scalar, m: int) -> Tangents:
    """The same with a column for the duration behind the first m."""
    first, others = at.columns[:, :m], at.columns[:, m:]
    return Tangents(at.state, jnp.concatenate([first, rate[:, None], others], axis=1))


def _arrival(spec: ReturnMapSpec, y: PyTree, args: PyTree) -> Scalar:
    """The section's value and its rate."""

    def surface(y: PyTree) -> Scalar:
        return spec.system.arrival(spec.section, args, y)[0]

    rates = spec.system.vector_field(jnp.zeros(()), y, args)
    return jnp.stack(jax.jvp(surface, (y,), (rates,)))


def _components(y: PyTree, _: PyTree) -> Scalar:
    return jnp.stack(jtu.tree_leaves(y))


def _along(path: tuple[Extreme, ...], y: PyTree, scene: PyTree) -> Scalar:
    motion = WalkerMotion(scene, motion_of(y))
    values = [jnp.asarray(extreme.value(motion)) for extreme in path]
    return jnp.stack(values) if values else jnp.zeros(0)


def _rows(of: Linearised, places: tuple[int, ...]) -> Linearised:
    where = jnp.asarray(places, dtype=int)
    return Linearised(of.values[:, where], of.slopes[:, where])
