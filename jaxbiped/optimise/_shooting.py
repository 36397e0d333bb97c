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
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._walker_motion import WalkerMotion
from jaxbiped.gait._poincare_map import recurring_indices, state_with
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.hybrid._motion_costs import Extreme
from jaxbiped.optimise._augmented_system import motion_of
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._watch import Watch
from jaxbiped.variational._tangents import (
    SectionSolve,
    Seeded,
    Tangents,
    along_columns,
    with_active,
)
from jaxbiped.variational._variational_solve import seeded_directions, tangents_after


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
