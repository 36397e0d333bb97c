"""Poincaré map: one return to the section, with its Jacobian.

Newton's method, multipliers and sensitivities all read this one evaluation.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, by_numpy
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import Recorded
from jaxbiped.dynamics._equivalent_states import minimal_state, redundant_state
from jaxbiped.gait._return_map_spec import ReturnMapSpec
from jaxbiped.hybrid._scales import recurring_inverse_units
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._watch import Watch
from jaxbiped.variational._solve_to_section import Nodes, SectionArrival, solve_to_section
from jaxbiped.variational._tangents import SectionSolve, Seeded, Tangents, along_columns, as_columns
from jaxbiped.variational._variational_solve import solve_to_section_by_lanes

STATE_FLOOR = 0.1
"""Size below which errors of derivatives with respect to the state are absolute, in the scene's
units."""
PARAMETER_FLOOR = 1e-4
"""The same with respect to a parameter's logarithm: small sensitivities are wanted, too."""


class LinearisedReturn(NamedTuple):
    """One return, with derivatives along n = m + p directions.

    Those of the m recurring components come first, then each of the p parameters' in units of its
    size (1 where it is zero).

    Attributes:
        recurring: the components that must return, SI units, shape (m,).
        jacobian: their derivatives on the section, shape (m, n).
        monodromy: their derivatives at a fixed time, shape (m, n).
        velocity: their rates where the cycle ends, shape (m,).
        period, period_row: duration [s], and its derivatives, shape (n,).
        advance, advance_rows: what the d cyclic coordinates gained, shape (d,), and (d, n).
        peak, peak_row: largest load, and (n,). Zeros where the system has none.
        code: 0 or that of an `Ending`.
        attempted: solver steps attempted.
        jumps: crossings where the vector field itself jumped.
        grazes: how often a switch was touched, or missed, by less than the tolerance resolves:
            derivatives are then those of one side.
        nodes: the ends of the steps of each solve to the section, leaves (steps, …), where saved.
    """

    recurring: Scalar
    jacobian: Scalar
    monodromy: Scalar
    velocity: Scalar
    period: Scalar
    period_row: Scalar
    advance: Scalar
    advance_rows: Scalar
    peak: Scalar
    peak_row: Scalar
    code: Scalar
    attempted: Scalar
    jumps: Scalar
    grazes: Scalar
    nodes: Nodes | None


def recurring_indices(system: AbstractSystem, y: PyTree) -> list[int]:
    """Positions of the leaves that must return."""
    return [i for i in range(len(jtu.tree_leaves(y))) if i not in system.cyclic_coordinates]


def recurring_components(system: AbstractSystem, y: PyTree) -> Scalar:
    """The components that must return, shape (m,)."""
    leaves = jtu.tree_leaves(y)
    parts = [leaves[i] for i in recurring_indices(system, y)]
    return by_numpy(lambda numpy, *leaves: numpy.stack(leaves), *parts)


def state_with(system: AbstractSystem, like: PyTree, recurring: Scalar) -> PyTree:
    """A state with these recurring components, and zero for the cyclic coordinates."""
    leaves, structure = jtu.tree_flatten(like)
    places = recurring_indices(system, like)
    zero = jnp.zeros_like(recurring[0])
    filled = [recurring[places.index(i)] if i in places else zero for i in range(len(leaves))]
    return jtu.tree_unflatten(structure, filled)


def seed_directions(args: PyTree, active: tuple[int, ...], m: int) -> tuple[Seeded, Scalar]:
    """Seeds for m directions of state and then one for each active parameter.

    A parameter moves by its size (its logarithm by one), by one where that is 0. Also sizes, (p,).
    """
    leaves = jtu.tree_leaves(args)
    values = [jax.lax.stop_gradient(leaves[i]) for i in active]
    sizes = jnp.stack(values) if values else jnp.zeros(0)
    sizes = jnp.where(sizes == 0.0, 1.0, sizes)
    seeds = jnp.concatenate([jnp.zeros((len(active), m)), jnp.diag(sizes)], axis=1)
    by_state = STATE_FLOOR * recurring_inverse_units(args, m)
    floors = jnp.concatenate([by_state, jnp.full(len(active), PARAMETER_FLOOR)])
    return Seeded(args, seeds, floors, active), sizes


@cached_jit  # for its trace cache
def linearised_return(
    spec: ReturnMapSpec,
    args: Seeded,
    y: PyTree,
    precision: Precision,
    idle: Scalar | bool,
    *,
    carries_parameters: Scalar | bool = True,
) -> LinearisedReturn:
    """Follows the orbit from `y` for one cycle, with derivatives; nothing where `idle`.

    Unless it `carries_parameters`, derivatives with respect to parameters choose no steps, and
    lanes do without them.
    """
    places = recurring_indices(spec.system, y)
    count, n = len(jtu.tree_leaves(y)), args.seeds.shape[1]
    start = jnp.zeros((count, n)).at[jnp.asarray(places), jnp.arange(len(places))].set(1.0)
    state, moved = along_columns(lambda s, a: spec.system.on_held(a, s), Tangents(y, start), args)
    watch = _watch_for(spec, args.args, y)
    limit = jnp.where(idle, 0.0, spec.max_time)

    def one(
        before: tuple[Tangents, Scalar], _: None
    ) -> tuple[tuple[Tangents, Scalar], tuple[SectionArrival, Scalar, Scalar]]:
        y0, failed = before
        y0 = _entry_coordinates(spec, y0, args)
        within = jnp.where(failed != 0, 0.0, limit)
        found = _next_arrival(spec, watch, y0, args, precision, within, carries_parameters)
        state, on_section = found.y
        # At a fixed time the reset comes earlier or later, and the motion after it with it.
        rates = spec.system.vector_field(jnp.zeros(()), state, args.args)
        velocity = jnp.stack(jtu.tree_leaves(rates))
        columns = on_section - velocity[:, None] * found.time_columns
        code = jnp.where(failed != 0, failed, found.code)
        return (Tangents(state, columns), code), (found, on_section, velocity)

    begin = (Tangents(state, as_columns(moved)), jnp.asarray(0))
    if spec.steps == 1:
        (end, code), last = one(begin, None)
        every = jax.tree.map(lambda leaf: leaf[None], last)
    else:
        (end, code), every = jax.lax.scan(one, begin, length=spec.steps)
    arrivals, on_section, velocity = every
    return _chain_arrivals(spec, y, end, code, arrivals, on_section[-1], velocity[-1])


def _watch_for(spec: ReturnMapSpec, args: PyTree, y: PyTree) -> Watch:
    """What the solves of a cycle end on."""
    if spec.within is None:
        return spec.watch(args, y)
    inside = eqx.filter_eval_shape(redundant_state, args, y)
    return spec.watch(args, inside, of=spec.within)


def _entry_coordinates(spec: ReturnMapSpec, y: Tangents, args: Seeded) -> Tangents:
    """The start of a solve in the coordinates that it is done in."""
    if spec.within is None:
        return y
    state, columns = along_columns(lambda s, a: redundant_state(a, s), y, args)
    return Tangents(state, as_columns(columns))


class _Exit(eqx.Module):
    """The state behind the reset, in the cycle's own coordinates."""

    system: AbstractSystem

    def __call__(self, args: PyTree, y: PyTree) -> PyTree:
        return self.system.reset_map(args, minimal_state(args, y))


def _exit_coordinates(spec: ReturnMapSpec, found: SectionArrival, args: Seeded) -> SectionArrival:
    """A solve's arrival in the cycle's own coordinates, behind the reset."""
    reset = spec.system.reset_map
    if spec.within is None:
        state, moved = along_columns(lambda s, a: reset(a, s), found.y, args)
        return found._replace(y=Tangents(state, as_columns(moved)))
    leave = _Exit(spec.system)
    state, columns = along_columns(lambda s, a: leave(a, s), found.y, args)
    nodes = found.nodes
    if nodes is not None:
        assert isinstance(nodes.ends, Recorded)
        structure = jtu.tree_structure(found.y.state)

        def left(rows: Scalar) -> Scalar:
            inside = jtu.tree_unflatten(structure, list(jnp.moveaxis(rows[..., 1:], -1, 0)))
            outside = jtu.tree_leaves(minimal_state(args.args, inside))
            return jnp.stack([rows[..., 0], *outside], axis=-1)

        ends = Recorded(left(jnp.asarray(nodes.ends.values)), nodes.ends.counts)  # type: ignore[arg-type]
        nodes = Nodes(left(nodes.start), ends, left(nodes.arrival), nodes.steps)
    return found._replace(y=Tangents(state, as_columns(columns)), nodes=nodes)


def _next_arrival(
    spec: ReturnMapSpec,
    watch: Watch,
    y0: Tangents,
    args: Seeded,
    precision: Precision,
    limit: Scalar,
    carries_parameters: Scalar | bool,
) -> SectionArrival:
    """The next arrival, by the engine that is asked for, and there the state behind the reset."""
    how = SectionSolve(watch, spec.solver, precision, limit, spec.max_solver_steps)
    m = args.seeds.shape[1] - len(args.active)
    if spec.programs is None:
        deaf = (jnp.arange(len(args.floors)) >= m) & ~jnp.asarray(carries_parameters)
        floors = jnp.where(deaf, jnp.inf, args.floors)
        args = Seeded(args.args, args.seeds, floors, args.active)
        found = solve_to_section(how, y0, args, save_nodes=True)
        return _exit_coordinates(spec, found, args)
    sizes = jnp.diagonal(args.seeds[:, m:])
    arrival, told = spec.system.reset_map, None
    if spec.within is not None:
        arrival, told = _Exit(spec.system), minimal_state
    how = how._replace(watch=dataclasses.replace(watch, arrival=arrival, told=told))
    return solve_to_section_by_lanes(how, y0, args, sizes, carries_parameters, spec.programs)


def _chain_arrivals(
    spec: ReturnMapSpec,
    y: PyTree,
    end: Tangents,
    code: Scalar,
    arrivals: SectionArrival,
    on_section: Scalar,
    velocity: Scalar,
) -> LinearisedReturn:
    places = jnp.asarray(recurring_indices(spec.system, y))
    cyclic_coordinates = jnp.asarray(spec.system.cyclic_coordinates, dtype=int)
    last = spec.system.unwrapped(y, end.state)
    before, after = jnp.stack(jtu.tree_leaves(y)), jnp.stack(jtu.tree_leaves(last))
    highest = jnp.argmax(arrivals.peak)
    return LinearisedReturn(
        recurring=after[places],
        jacobian=on_section[places],
        monodromy=end.columns[places],
        velocity=velocity[places],
        period=jnp.sum(arrivals.time),
        period_row=arrivals.time_columns[-1],
        advance=(after - before)[cyclic_coordinates],
        advance_rows=on_section[cyclic_coordinates],
        peak=arrivals.peak[highest],
        peak_row=arrivals.peak_columns[highest],
        code=code,
        attempted=jnp.sum(arrivals.attempted),
        jumps=jnp.sum(arrivals.jumps),
        grazes=jnp.sum(arrivals.grazes),
        nodes=arrivals.nodes,
    )
