"""Second derivatives of a turn, with the jumps that switches give them.

Across a switch the Jacobian J of the vector field jumps, so its derivative holds a pulse that no
derivative taken through solver steps can see. For two tangents V and Q of the motion, and a
switch g = 0 crossed at the rate ġ, the mixed second tangent C jumps by
(J₊ − J₋) V (dg·Q)/ġ. Between switches C' = J C + f''[V, Q] is a linear equation, solved here by
the Radau IIA method of order five (Hairer and Wanner, Solving Ordinary Differential Equations II,
section IV.5) on the steps that the first derivatives chose, many steps at once. After a switch f''
may be as singular as the inverse root of the time since (Hertz's law after touchdown), so the
method runs in the root of that time, in which it is smooth.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.dynamics._switches import Switch
from jaxbiped.solve._fence import fenced

_MARGIN, _SHARE = 1e-12, 1e-3
"""Least time from a switch [s], and least share of a step's overshoot, at which its sides are
looked at: far enough to be sure of the side, near enough that only the jump is seen."""
_LONG_AGO = 1.0
"""Time [s] since the last switch, where none is known."""
CHUNK = 64
"""Steps that are solved at once."""
_ROOT = 6.0**0.5
_NODES = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
_RADAU = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)
Rates = Callable[[Scalar], Scalar]
"""Components and parameters in one vector (c + p,) to the rates (c,)."""


class Bent(NamedTuple):
    """Tangents of a motion and their mixed second tangents. c components, p parameters.

    Attributes:
        first: v tangents V and after them q tangents Q, shape (c, v + q).
        second: mixed tangents C, shape (c, q, v).
    """

    first: Scalar
    second: Scalar


class Path(NamedTuple):
    """Consecutive steps of a solved motion, at most `CHUNK`; idle ones have no span.

    Attributes:
        before, after: states, shape (steps, c).
        start, span: times of their starts and their durations [s], shape (steps,).
        switched: time of the last switch before each [s].
    """

    before: Scalar
    after: Scalar
    start: Scalar
    span: Scalar
    switched: Scalar

    def clock(self) -> tuple[Scalar, Scalar]:
        """Of the collocation points: the part of the step before each, and its share of time.

        Both of shape (steps, 3). A share is the derivative of time by the step's own variable,
        which runs evenly in the root of the time since the last switch.
        """
        since = self.start - self.switched
        first, last = jnp.sqrt(since), jnp.sqrt(since + self.span)
        width = jnp.where(self.span > 0.0, self.span / (first + last), 0.0)
        root = first[:, None] + width[:, None] * _NODES
        moved = width[:, None] * _NODES * (root + first[:, None])
        part = moved / jnp.where(self.span > 0.0, self.span, 1.0)[:, None]
        return part, 2.0 * root * width[:, None]


class Crossings(NamedTuple):
    """The switch that each step ends just past, if any; leaves of shape (steps,).

    No step is taken to cross two at once.

    Attributes:
        crossed: whether there is one.
        past: time from the switch to the step's end [s]; 0 where there is none.
        margin: time from the switch at which its sides are looked at [s].
        early: how much earlier a change of components and parameters makes the crossing,
            shape (steps, c + p).
    """

    crossed: Scalar
    past: Scalar
    margin: Scalar
    early: Scalar


def along_path(
    rates: Rates,
    surfaces: Callable[[Scalar], Sequence[Switch]],
    times: Scalar,
    states: Scalar,
    parameters: Scalar,
    bent: Bent,
    seeds: Scalar,
    count: int,
) -> Bent:
    """Carries tangents along a motion whose steps end at `times` and `states`.

    Args:
        rates: the vector field.
        surfaces: switches of a vector of components and parameters.
        times: shape (s + 1,), infinite beyond the motion's end.
        states: shape (s + 1, c).
        parameters: shape (p,).
        bent: tangents at the start, V first; `count` = v of them.
        seeds: derivatives of the parameters along V and Q, shape (p, v + q).
        count: v.
    """
    steps = jnp.sum(jnp.isfinite(times)) - 1
    room = -(-(times.shape[0] - 1) // CHUNK) * CHUNK + 1
    pad = [(0, room - times.shape[0])]
    times = jnp.pad(times, pad, constant_values=jnp.inf)
    states = jnp.pad(states, [*pad, (0, 0)], mode="edge")
    known = jnp.isfinite(times)
    last_time = jax.lax.dynamic_index_in_dim(times, steps, keepdims=False)
    last_state = jax.lax.dynamic_index_in_dim(states, steps, keepdims=False)
    times = jnp.where(known, times, last_time)
    states = jnp.where(known[:, None], states, last_state)

    def chunk(carried: tuple[Scalar, Scalar, Bent]) -> tuple[Scalar, Scalar, Bent]:
        start, switched, now = carried
        t = jax.lax.dynamic_slice_in_dim(times, start, CHUNK + 1)
        y = jax.lax.dynamic_slice_in_dim(states, start, CHUNK + 1)
        found = _crossings(rates, surfaces, y[:-1], y[1:], parameters)
        latest = jnp.where(found.crossed, t[1:], -jnp.inf)
        latest = jax.lax.cummax(jnp.concatenate([switched[None], latest]))
        path = Path(y[:-1], y[1:], t[:-1], jnp.diff(t), latest[:-1])
        after = _chunk(rates, path, found, parameters, now, seeds, count)
        return start + CHUNK, latest[-1], after

    begin = (jnp.asarray(0), times[0] - _LONG_AGO, bent)
    return jax.lax.while_loop(lambda c: c[0] < steps, chunk, begin)[2]


def _chunk(
    rates: Rates,
    path: Path,
    crossings: Crossings,
    parameters: Scalar,
    bent: Bent,
    seeds: Scalar,
    count: int,
) -> Bent:
    c = path.before.shape[1]
    part, share = path.clock()
    points = _stages(rates, path, part, share, parameters)
    # A step that ends past a switch belongs to the old side up to its end.
    back = jnp.where(crossings.crossed, crossings.past + crossings.margin, 0.0)[:, None]
    field = jax.vmap(lambda y: rates(jnp.concatenate([y, parameters])))
    points = points.at[:, 2].add(-back * field(points[:, 2]))
    jacobians = _gradients(rates, points, parameters)
    inverse = jnp.linalg.inv(_collocation(jacobians[..., :c], share))
    units = jnp.tile(jnp.eye(c), (3, 1))
    forcing = _spread(jacobians[..., c:], share)
    units = jnp.broadcast_to(units, (*forcing.shape[:1], 3 * c, c))
    stage_map = inverse @ jnp.concatenate([units, forcing], axis=-1)
    step_map = stage_map[:, 2 * c :]

    def follow(first: Scalar, step: Scalar) -> tuple[Scalar, Scalar]:
        return step @ jnp.concatenate([first, seeds]), first

    last, firsts = jax.lax.scan(follow, bent.first, step_map)
    seeded = jnp.broadcast_to(seeds, (firsts.shape[0], *seeds.shape))
    at_stages = stage_map @ jnp.concatenate([firsts, seeded], axis=1)
    at_stages = at_stages.reshape(-1, 3, c, seeds.shape[1])
    moved = _with_seeds(at_stages[..., count:], seeds[:, count:])

    def source(turned: Scalar, turned_seeds: Scalar) -> Scalar:
        bend = _gradients(rates, points, parameters, turned, turned_seeds)
        return (inverse @ _spread(bend @ moved, share))[:, 2 * c :]

    by_direction = jax.vmap(source, in_axes=(-1, -1), out_axes=-1)
    sources = by_direction(at_stages[..., :count], seeds[:, :count])
    ends = jnp.concatenate([firsts[1:], last[None]])
    jumps = _jumps(rates, path.after, crossings, parameters, ends, seeds, count)

    def gather(second: Scalar, step: tuple[Scalar, Scalar]) -> tuple[Scalar, None]:
        matrix, source = step
        return jnp.einsum("ab,bqv->aqv", matrix, second) + source, None

    second, _ = jax.lax.scan(gather, bent.second, (step_map[..., :c], sources + jumps))
    return Bent(last, second)


def _stages(rates: Rates, path: Path, part: Scalar, share: Scalar, parameters: Scalar) -> Scalar:
    """States at the collocation points, shape (steps, 3, c): a cubic, once corrected."""
    field = jax.vmap(lambda y: rates(jnp.concatenate([y, parameters])))
    h = path.span[:, None]
    start, end = h * field(path.before), h * field(path.after)
    change = path.after - path.before
    second, third = 3.0 * change - 2.0 * start - end, start + end - 2.0 * change
    s, before = part[..., None], path.before[:, None]
    points = before + s * (start[:, None] + s * (second[:, None] + s * third[:, None]))
    c = path.before.shape[1]
    slopes = share[..., None] * jax.vmap(field)(points)
    residual = points - before - jnp.einsum("ij,njc->nic", _RADAU, slopes)
    matrix = _collocation(_gradients(rates, points, parameters)[..., :c], share)
    correction = jnp.linalg.solve(matrix, residual.reshape(-1, 3 * c, 1))
    return points - correction.reshape(points.shape)


def _gradients(
    rates: Rates,
    points: Scalar,
    parameters: Scalar,
    along: Scalar | None = None,
    along_parameters: Scalar | None = None,
) -> Scalar:
    """Derivatives of the rates, or of their derivative along a tangent; (steps, 3, c, c + p).

    By reverse mode: the rates are few.
    """
    size = points.shape[-1]
    unit = jnp.eye(size)

    def pulls(y: Scalar, tangent: Scalar) -> Any:
        z = jnp.concatenate([y, parameters])
        if along is None or along_parameters is None:
            return jax.vjp(rates, z)[1]
        whole = jnp.concatenate([tangent, along_parameters])
        return jax.vjp(lambda z: jax.jvp(rates, (z,), (whole,))[1], z)[1]

    flat = points.reshape(-1, size)
    tangents = flat if along is None else along.reshape(-1, size)
    moves = jnp.isfinite(jnp.sum(flat))
    every = fenced(moves, lambda: jax.vmap(pulls)(flat, tangents))
    rows = fenced(moves, lambda: jax.vmap(lambda pull: jax.vmap(lambda e: pull(e)[0])(unit))(every))
    return rows.reshape(*points.shape, size + parameters.shape[0])


def _collocation(jacobians: Scalar, share: Scalar) -> Scalar:
    """I − A ⊗ (share_j J_j), shape (steps, 3 c, 3 c)."""
    steps, _, c, _ = jacobians.shape
    blocks = jnp.einsum("ij,njab->niajb", _RADAU, share[..., None, None] * jacobians)
    return jnp.eye(3 * c) - blocks.reshape(steps, 3 * c, 3 * c)


def _spread(forcing: Scalar, share: Scalar) -> Scalar:
    """(A ⊗ I) (share_j b_j) of forcings (steps, 3, c, n), shape (steps, 3 c, n)."""
    steps, _, c, n = forcing.shape
    total = jnp.einsum("ij,njab->niab", _RADAU, share[..., None, None] * forcing)
    return total.reshape(steps, 3 * c, n)


def _with_seeds(tangents: Scalar, seeds: Scalar) -> Scalar:
    """Tangents (…, c, n) with those of the parameters (p, n) below them."""
    below = jnp.broadcast_to(seeds, (*tangents.shape[:-2], *seeds.shape))
    return jnp.concatenate([tangents, below], axis=-2)


def _crossings(
    rates: Rates,
    surfaces: Callable[[Scalar], Sequence[Switch]],
    before: Scalar,
    after: Scalar,
    parameters: Scalar,
) -> Crossings:
    def values(z: Scalar) -> Scalar:
        return jnp.stack([jnp.zeros(()), *(surface.value for surface in surfaces(z))])

    def live(z: Scalar) -> Scalar:
        return jnp.stack([jnp.asarray(False), *(jnp.asarray(s.live) for s in surfaces(z))])

    def one(before: Scalar, after: Scalar) -> Crossings:
        old, z = (jnp.concatenate([y, parameters]) for y in (before, after))
        rate = jnp.concatenate([rates(z), jnp.zeros_like(parameters)])
        past, gradients = values(z), jax.jacrev(values)(z)
        crossed = ((values(old) > 0.0) != (past > 0.0)) & (live(old) | live(z))
        which = jnp.argmax(crossed)
        gradient, found = gradients[which], crossed[which]
        slope = jnp.where(found, gradient @ rate, 1.0)
        time_past = jnp.where(found, past[which] / slope, 0.0)
        margin = jnp.maximum(_MARGIN, _SHARE * time_past)
        return Crossings(found, time_past, margin, jnp.where(found, gradient / slope, 0.0))

    return jax.vmap(one)(before, after)


def _jumps(
    rates: Rates,
    after: Scalar,
    crossings: Crossings,
    parameters: Scalar,
    firsts: Scalar,
    seeds: Scalar,
    count: int,
) -> Scalar:
    """Jumps of C at the end of each step, shape (steps, c, q, v); zero where none is crossed."""
    field = jax.vmap(lambda y: rates(jnp.concatenate([y, parameters])))
    back = crossings.past[:, None] + crossings.margin[:, None] * jnp.array([-1.0, 1.0, -2.0, 2.0])
    points = after[:, None] - back[..., None] * field(after)[:, None]
    new, old, further, older = jnp.moveaxis(_gradients(rates, points, parameters), 1, 0)
    # Extrapolated to the switch itself: the Jacobian varies fast on either side.
    jump = 2.0 * (new - old) - (further - older)
    moved = _with_seeds(firsts, seeds)
    early = jnp.einsum("sz,szq->sq", crossings.early, moved[..., count:])
    return jnp.einsum("scv,sq->scqv", jump @ moved[..., :count], early)


def on_surface(
    rates: Rates,
    surface: Callable[[Scalar], Scalar],
    z: Scalar,
    bent: Bent,
    seeds: Scalar,
    count: int,
) -> tuple[Bent, Bent]:
    """Tangents at a fixed time turned into tangents on the surface g = 0 that `z` lies on.

    A tangent V moves the arrival by τ_V = −dg·V/ġ and becomes V + f τ_V. Differentiated once more,
    C becomes C + (J V) τ_Q + (J Q) τ_V + (J f) τ_V τ_Q + f τ_VQ, where τ_VQ keeps it on the surface.
    Also the times: τ_V as `first` (v + q,) and τ_VQ as `second` (q, v).
    """
    c = bent.first.shape[0]
    moved = jnp.concatenate([bent.first, seeds])
    rate = rates(z)
    flow = jnp.concatenate([rate, jnp.zeros(seeds.shape[0])])

    def turned(along: Scalar) -> Scalar:
        return jax.jvp(rates, (z,), (along,))[1]

    gradient = jax.grad(surface)(z)
    slope = gradient @ flow
    times = -(gradient @ moved) / slope
    on = moved + flow[:, None] * times
    bends = jax.vmap(turned, in_axes=-1, out_axes=-1)(moved)
    by_v, by_q = times[:count], times[count:]
    second = bent.second + jnp.einsum("cv,q->cqv", bends[:, :count], by_q)
    second = second + jnp.einsum("cq,v->cqv", bends[:, count:], by_v)
    second = second + jnp.einsum("c,q,v->cqv", turned(flow), by_q, by_v)
    curved = jnp.einsum("aq,ab,bv->qv", on[:, count:], jax.hessian(surface)(z), on[:, :count])
    both = -(curved + jnp.einsum("c,cqv->qv", gradient[:c], second)) / slope
    second = second + jnp.einsum("c,qv->cqv", rate, both)
    return Bent(on[:c], second), Bent(times, both)


def bend(
    function: Callable[[Scalar], Scalar], z: Scalar, bent: Bent, seeds: Scalar, count: int
) -> tuple[Scalar, Bent]:
    """A function of components and parameters (c + p,), and its tangents in place of theirs."""
    moved = jnp.concatenate([bent.first, seeds])
    value = function(z)

    def slope(z: Scalar, along: Scalar) -> Scalar:
        return jax.jvp(function, (z,), (along,))[1]

    first = jax.vmap(lambda along: slope(z, along), in_axes=-1, out_axes=-1)(moved)

    def mixed(along: Scalar, tangent: Scalar, second: Scalar) -> Scalar:
        idle = jnp.zeros(seeds.shape[0])
        change = jnp.concatenate([second, idle])
        return jax.jvp(slope, (z, along), (tangent, change))[1]

    by_tangent = jax.vmap(mixed, in_axes=(None, -1, -1), out_axes=-1)
    by_both = jax.vmap(by_tangent, in_axes=(-1, None, -1), out_axes=-1)
    return value, Bent(first, by_both(moved[:, :count], moved[:, count:], bent.second))
