"""Curvature of a flow: second derivatives, with the jumps that switches give them.

Across a switch the Jacobian J of the vector field jumps, so its derivative holds a pulse that no
derivative taken through solver steps can see. For two tangents V and Q of the motion, and a
switch g = 0 crossed at the rate ġ, the mixed second tangent C jumps by
(J₊ − J₋) V (dg·Q)/ġ. Between switches C' = J C + f''[V, Q] is a linear equation, solved here by
the Radau IIA method of order five (Hairer and Wanner, Solving Ordinary Differential Equations II,
section IV.5) on the steps that the first derivatives chose, many steps at once. After a switch f''
may be as singular as the inverse root of the time since (Hertz's law after touchdown), so the
method runs in the root of that time, in which it is smooth.

A tangent may hold much of the flow itself: where a parameter makes the motion later, it does. Of
that part C is known exactly, and yet it is the largest and changes fastest. So at every step's
start what V and Q have of the flow is taken out, which is only to read their motions at other
times, and C changes with it.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.variational._flow import Flow
from jaxbiped.variational._jets import Jet
from jaxbiped.variational._radau_collocation import (
    Path,
    Rates,
    collocation,
    collocation_points,
    gradients,
    velocities,
    with_seeds,
)
from jaxbiped.variational._switch_crossings import (
    Crossings,
    crossings_of,
    earlier_at,
    jet_jump,
    jump_of,
    sides_of,
)
from jaxbiped.variational._switch_locator import MARGIN

LONG_AGO = 1.0
"""Time [s] since the last switch, where none is known."""
SETTLED = 1e-9
"""How long after a switch the first step ends at the earliest [s], however short the solve's own
are: penetrations that are mostly rounding make the singular f'' there, and all after it, noise."""
CHUNK = 64
"""Steps that are solved at once."""


def jet_along_path(
    flow: Flow,
    times: Scalar,
    states: Scalar,
    parameters: Scalar,
    jet: Jet,
    seeds: Scalar,
    count: int,
) -> Jet:
    """Carries tangents along a motion whose steps end at `times` and `states`.

    Args:
        flow: what moves.
        times: shape (s + 1,), infinite beyond the motion's end.
        states: shape (s + 1, c).
        parameters: shape (p,).
        jet: tangents at the start, V first; `count` = v of them.
        seeds: derivatives of the parameters along V and Q, shape (p, v + q).
        count: v.
    """
    steps = jnp.sum(jnp.isfinite(times)) - 1
    room = -(-(times.shape[0] - 1) // CHUNK) * CHUNK + 1
    pad = [(0, room - times.shape[0])]
    times = jnp.pad(times, pad, constant_values=jnp.inf)
    states = jnp.pad(states, [*pad, (0, 0)], mode="edge")
    real = jnp.isfinite(times)
    last_time = jax.lax.dynamic_index_in_dim(times, steps, keepdims=False)
    last_state = jax.lax.dynamic_index_in_dim(states, steps, keepdims=False)
    times = jnp.where(real, times, last_time)
    states = jnp.where(real[:, None], states, last_state)

    def chunk(carried: tuple[Scalar, _Reached, Jet]) -> tuple[Scalar, _Reached, Jet]:
        start, reached, now = carried
        t = jax.lax.dynamic_slice_in_dim(times, start, CHUNK + 1)
        y = jax.lax.dynamic_slice_in_dim(states, start, CHUNK + 1)
        found = crossings_of(flow, flow.surfaces, y[:-1], y[1:], parameters)
        path, reached = _path(reached, t[1:] - found.past, found, last_time)
        after = _chunk(flow, path, found, parameters, now, seeds, count)
        return start + CHUNK, reached, after

    never = jnp.asarray(False)
    reached = _Reached(times[0], states[0], never, times[0] - LONG_AGO)
    begin = (jnp.asarray(0), reached, jet)
    return jax.lax.while_loop(lambda c: c[0] < steps, chunk, begin)[2]


class _Reached(NamedTuple):
    """Where a chunk begins: time and state, whether on a switch, and the last switch's time."""

    time: Scalar
    state: Scalar
    on_switch: Scalar
    switched: Scalar


def _path(
    reached: _Reached, times: Scalar, crossings: Crossings, last: Scalar
) -> tuple[Path, _Reached]:
    """The steps of a chunk; those that ended past a switch end on it.

    Those that end too soon behind one have no span, and the next one begins where they did. The
    motion's `last` is none of them.
    """

    def begun(first: Scalar, rest: Scalar) -> Scalar:
        return jnp.concatenate([first[None], rest])

    clock, states = begun(reached.time, times), begun(reached.state, crossings.landed)
    fresh = begun(reached.on_switch, crossings.crossed)
    latest = jnp.where(crossings.crossed, times, -jnp.inf)
    latest = jax.lax.cummax(begun(reached.switched, latest))
    soon = (clock[1:] - latest[:-1] < SETTLED) & ~crossings.crossed & (times < last)
    places = jnp.arange(len(clock))
    source = jax.lax.cummax(jnp.where(begun(jnp.asarray(False), soon), 0, places))
    start, before, ready = clock[source], states[source], fresh[source]
    span = jnp.where(soon, 0.0, jnp.maximum(clock[1:] - start[:-1], 0.0))
    after = jnp.where(soon[:, None], before[:-1], states[1:])
    path = Path(before[:-1], after, start[:-1], span, latest[:-1], ready[:-1])
    return path, _Reached(start[-1], before[-1], ready[-1], latest[-1])


class _Linear(NamedTuple):
    """The vector field about the steps of a chunk.

    Attributes:
        points: states at the collocation points, shape (steps, 3, c).
        jacobians: derivatives of the rates there with respect to components and parameters.
        at_start: the same where each step starts, shape (steps, c, c + p).
        velocities: rates there, shape (steps, c).
        jump: by how much the derivatives jump where each step ends.
    """

    points: Scalar
    jacobians: Scalar
    at_start: Scalar
    velocities: Scalar
    jump: Scalar


def _linear(rates: Rates, path: Path, crossings: Crossings, parameters: Scalar) -> _Linear:
    points = collocation_points(rates, path, parameters)
    # A step that ends on a switch belongs to the old side; a corrected point may lie beyond.
    short = path.after - MARGIN * velocities(rates, path.after, parameters)
    points = points.at[:, 2].set(jnp.where(crossings.crossed[:, None], short, points[:, 2]))
    sides = sides_of(rates, crossings, parameters)
    every = jnp.concatenate([points, path.before[:, None], sides], axis=1)
    found = gradients(rates, every, parameters)
    return _Linear(
        points,
        found[:, :3],
        found[:, 3],
        velocities(rates, path.before, parameters),
        jump_of(found[:, 4:]),
    )


def _chunk(
    flow: Flow,
    path: Path,
    crossings: Crossings,
    parameters: Scalar,
    jet: Jet,
    seeds: Scalar,
    count: int,
) -> Jet:
    c = path.before.shape[1]
    linear = _linear(flow, path, crossings, parameters)
    stages = collocation(path, linear.jacobians)
    step_map = stages.steps()

    def follow(first: Scalar, each: tuple[Scalar, ...]) -> tuple[Scalar, tuple[Scalar, ...]]:
        step, velocity, fresh = each
        shift = jnp.where(fresh, 0.0, (velocity @ first) / (velocity @ velocity))
        begun = first - velocity[:, None] * shift
        end = step @ jnp.concatenate([begun, seeds])
        return end, (first, shift, begun, end)

    steps = (step_map, linear.velocities, path.fresh)
    last, (arrived, shifts, firsts, ends) = jax.lax.scan(follow, jet.first, steps)
    at_stages = stages.within(firsts, seeds)
    seeded = with_seeds(at_stages[..., count:], seeds[:, count:])

    def source(tangent_v: Scalar, seeds_along: Scalar) -> Scalar:
        second_derivatives = gradients(flow, linear.points, parameters, tangent_v, seeds_along)
        return stages.forced(second_derivatives @ seeded)

    by_direction = jax.vmap(source, in_axes=(-1, -1), out_axes=-1)
    sources = by_direction(at_stages[..., :count], seeds[:, :count])
    early = jax.vmap(lambda y, which: earlier_at(flow, flow.surfaces, y, which, parameters))(
        crossings.landed, crossings.which
    )
    sources = sources + jet_jump(linear.jump, early, ends, seeds, count)
    shifted = _shift_correction(linear, arrived, shifts, seeds, count)

    def gather(second: Scalar, step: tuple[Scalar, ...]) -> tuple[Scalar, None]:
        matrix, shifted, source = step
        return jnp.einsum("ab,bqv->aqv", matrix, second + shifted) + source, None

    second, _ = jax.lax.scan(gather, jet.second, (step_map[..., :c], shifted, sources))
    return Jet(last, second)


def _shift_correction(
    linear: _Linear, arrived: Scalar, shifts: Scalar, seeds: Scalar, count: int
) -> Scalar:
    """What C gains where V loses σ f and Q loses τ f: −σ (Q)' − τ (V)' + σ τ f'."""
    c = linear.velocities.shape[1]
    flow = jnp.einsum("sab,sb->sa", linear.at_start[..., :c], linear.velocities)
    rates_of = linear.at_start @ with_seeds(arrived, seeds)
    by_v, by_q = shifts[:, :count], shifts[:, count:]
    both = jnp.einsum("sa,sq,sv->saqv", flow, by_q, by_v)
    both = both - jnp.einsum("sav,sq->saqv", rates_of[..., :count], by_q)
    return both - jnp.einsum("saq,sv->saqv", rates_of[..., count:], by_v)
