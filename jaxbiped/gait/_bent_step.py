"""One step of first and second tangents, one direction at a time, for lanes.

The equations are those of `_curvature` and the method that of `_radau`; here the components whose
rate is a component are eliminated by hand, and the step is one, not many.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.gait._crossings import SIDES, Crossings, jump_of
from jaxbiped.gait._radau import RADAU, Path
from jaxbiped.lanes._accumulation import jacobian
from jaxbiped.solve._elimination import solution_by_blocks
from jaxbiped.solve._landing import MARGIN
from jaxbiped.solve._linearisation import linearise

Field = Callable[[Sequence[Scalar], Sequence[Scalar]], list[Scalar]]
"""Rates of all components, of components and active parameters."""


class Order(NamedTuple):
    """Components in the order that the algebra wants: those whose rate is a component first.

    Attributes:
        every: positions of all components in that order.
        direct: how many come first; the rate of each is the component as far behind them.
    """

    every: tuple[int, ...]
    direct: int

    @property
    def kept(self) -> tuple[int, ...]:
        """Positions of the others."""
        return self.every[self.direct :]

    def sorted(self, vector: Any) -> Any:
        """The last axis of an array in this order."""
        return jnp.stack([vector[..., i] for i in self.every], axis=-1)

    def restored(self, vector: Any) -> Any:
        """The last axis of an array from this order in the components' own."""
        return jnp.stack(
            [vector[..., self.every.index(i)] for i in range(len(self.every))], axis=-1
        )


def order_of(field: Field, y: Sequence[Scalar], parameters: Sequence[Scalar]) -> Order:
    """The order of a field's components."""
    found = linearise(lambda t, y: field(y, parameters), jnp.zeros(()), list(y))
    direct, kept = found.direct(), found.kept()
    sources = list(direct.values())
    rest = [i for i in kept if i not in sources]
    return Order((*direct, *sources, *rest), len(direct))


class Stages(NamedTuple):
    """A step of y' = J y + b by Radau IIA, in the order of `order`; k components are kept.

    Attributes:
        order: of the components.
        weights: of the rates at the three collocation points in the changes up to each, (3, 3).
        by_direct: Jacobian of the kept rates by the d direct components there, (3, k, d).
        matrix: of the equations of the kept components at all points, (3 k, 3 k).
    """

    order: Order
    weights: Any
    by_direct: Any
    matrix: Any

    @staticmethod
    def of(order: Order, share: Any, jacobians: Any) -> "Stages":
        """From the Jacobians of the kept rates, (3, k, c), their columns in order."""
        weights = RADAU * share
        d, k = order.direct, len(order.kept)
        by_direct, by_kept = jacobians[..., :d], jacobians[..., d:]
        blocks = weights[:, None, :, None] * jnp.swapaxes(by_kept, 0, 1)[None]
        if d:
            # A direct component follows its rate: the equation of a second derivative.
            once = weights[:, :, None, None] * by_direct[None]
            twice = jnp.einsum("ijka,jl->ikla", once, weights)
            nothing = jnp.zeros((3, k, 3, k - d))
            blocks = blocks + jnp.concatenate([twice, nothing], axis=-1)
        matrix = jnp.eye(3 * k) - blocks.reshape(3 * k, 3 * k)
        return Stages(order, weights, by_direct, matrix)

    def solve(self, right: Any, forcing: Any, solved: Callable[[Any], Any]) -> Any:
        """u of (I − A ⊗ J) u = r + (A ⊗ I) b, shape (3, c), of r (3, c) and b of the kept (3, k).

        `solved` gives what the matrix takes to a vector.
        """
        d = self.order.direct
        direct, kept = right[:, :d], right[:, d:]
        pushed = forcing + (self.by_direct @ direct[..., None])[..., 0] if d else forcing
        found = solved((kept + self.weights @ pushed).reshape(-1)).reshape(3, -1)
        if not d:
            return found
        return jnp.concatenate([direct + self.weights @ found[:, :d], found], axis=1)


class Linear(NamedTuple):
    """The field about one step, all in order; n = c + p.

    Attributes:
        stages: the step's equations.
        points: states at the collocation points, (3, c), in the components' own order.
        by_parameter: derivatives of the kept rates there, (3, k, p).
        at_start: of the kept rates by all where the step starts, (k, n).
        velocity: rates there, (c,).
        jump: of the derivatives of the kept rates by the components where the step ends, (k, c).
    """

    stages: Stages
    points: Any
    by_parameter: Any
    at_start: Any
    velocity: Any
    jump: Any


def linear_about(
    field: Field, order: Order, path: Path, crossing: Crossings, parameters: Any
) -> Linear:
    """The field about the step of a `Path` whose leaves have no leading axis."""
    part, share = (each[0] for each in jax.tree.map(lambda x: x[None], path).clock())
    rows = _Rows(field, order, parameters)
    c = len(order.every)
    begins, ends = rows.velocity(path.before), rows.velocity(path.after)
    points = _collocated(rows, order, path, part, share, begins, ends)
    # A step that ends on a switch belongs to the old side; a corrected point may lie beyond.
    short = jnp.where(crossing.crossed, path.after - MARGIN * ends, points[2])
    points = jnp.concatenate([points[:2], short[None]])
    found = jax.lax.map(rows.gradient, jnp.concatenate([points, path.before[None]]))
    stages = Stages.of(order, share, found[:3, :, :c])

    def jump() -> Any:
        sides = crossing.landed + jnp.asarray(SIDES)[:, None] * ends
        return jump_of(jax.lax.map(rows.by_state, sides)[None])[0]

    jumps = jax.lax.cond(crossing.crossed, jump, lambda: jnp.zeros_like(found[3, :, :c]))
    return Linear(stages, points, found[:3, :, c:], found[3], order.sorted(begins), jumps)


def _collocated(
    rows: "_Rows", order: Order, path: Path, part: Any, share: Any, begins: Any, ends: Any
) -> Any:
    """The collocation points: a cubic, once corrected."""
    h, change = path.span, path.after - path.before
    start, end = h * begins, h * ends
    second, third = 3.0 * change - 2.0 * start - end, start + end - 2.0 * change
    s = part[:, None]
    points = path.before + s * (start + s * (second + s * third))
    velocities, found = jax.lax.map(lambda y: (rows.velocity(y), rows.by_state(y)), points)
    stages = Stages.of(order, share, found)
    residual = order.sorted(points - path.before - (RADAU * share) @ velocities)
    unforced = jnp.zeros((3, len(order.kept)))
    size = len(order.kept)
    off = stages.solve(
        residual,
        unforced,
        lambda right: solution_by_blocks(stages.matrix, right[:, None], size)[:, 0],
    )
    return points - order.restored(off)


class _Rows:
    """Rates and their derivatives at one point."""

    def __init__(self, field: Field, order: Order, parameters: Any) -> None:
        self.field, self.order, self.parameters = field, order, list(parameters)
        # Compiled by themselves, these are traced once, not at each use.
        self.by_state, self.bend = jax.jit(self._by_state), jax.jit(self._bend)

    def velocity(self, y: Any) -> Any:
        return jnp.stack(self.field(list(y), self.parameters))

    def _by_state(self, y: Any) -> Any:
        """Derivatives of the kept rates by the components, (k, c)."""
        return self.order.sorted(jacobian(lambda z: self._kept(z, self.parameters), list(y)))

    def gradient(self, y: Any) -> Any:
        """Derivatives of the kept rates, (k, n)."""
        return self._by_all(self._kept, list(y))

    def _bend(self, y: Any, along: Any) -> Any:
        """Derivatives of the kept rates' derivative along a tangent of the state, (k, n)."""
        tangent = list(along)

        def turned(y: list[Scalar], q: list[Scalar]) -> list[Scalar]:
            return jax.jvp(lambda y: self._kept(y, q), (y,), (tangent,))[1]

        return self._by_all(turned, list(y))

    def _kept(self, y: list[Scalar], q: list[Scalar]) -> list[Scalar]:
        every = self.field(y, q)
        return [every[i] for i in self.order.kept]

    def _by_all(self, function: Callable[..., list[Scalar]], y: list[Scalar]) -> Any:
        c = len(y)
        found = jacobian(lambda z: function(z[:c], z[c:]), [*y, *self.parameters])
        return jnp.concatenate([self.order.sorted(found[:, :c]), found[:, c:]], axis=1)


class Tangents(NamedTuple):
    """Rows in order: turned ones (v, c), families' (p, c), and mixed second ones (p, v, c)."""

    turned: Any
    family: Any
    second: Any


def tangent_step(
    field: Field,
    linear: Linear,
    crossing: Crossings,
    fresh: Any,
    sizes: Any,
    parameters: Any,
    before: Tangents,
) -> Tangents:
    """Tangents after the step.

    `sizes`, shape (p,): by how much each parameter moves along its family's tangent. The turned
    tangents move none.
    """
    order, stages, velocity = linear.stages.order, linear.stages, linear.velocity
    c, d = len(order.every), order.direct
    rows = _Rows(field, order, parameters)
    square = velocity @ velocity

    def flow_part(tangent: Any) -> Any:
        return jnp.where(fresh, 0.0, (tangent @ velocity) / square)

    def change_of(tangent: Any, forcing: Any) -> Any:
        """The rate of a tangent where the step starts."""
        kept = linear.at_start[:, :c] @ tangent + forcing
        return jnp.concatenate([tangent[d : 2 * d], kept]) if d else kept

    unit = jnp.eye(len(stages.matrix))
    matrix = solution_by_blocks(stages.matrix, unit, len(order.kept))

    def carried(start: Any, forcing: Any) -> Any:
        """At the collocation points, (3, c)."""
        return stages.solve(jnp.stack([start] * 3), forcing, lambda right: matrix @ right)

    none = jnp.zeros_like(linear.at_start[:, 0])
    count = before.turned.shape[0]
    shifts = [flow_part(before.turned[v]) for v in range(count)]
    rates = [change_of(before.turned[v], none) for v in range(count)]
    unforced = jnp.zeros_like(linear.by_parameter[..., 0])
    at_stages = [carried(before.turned[v] - shifts[v] * velocity, unforced) for v in range(count)]
    turned = jnp.stack([each[2] for each in at_stages])
    # Of one point all at once: much does not depend on the tangent.
    bends = jax.lax.map(
        lambda each: jnp.stack([rows.bend(each[0], tangent) for tangent in each[1]]),
        (linear.points, order.restored(jnp.stack(at_stages, axis=1))),
    )
    flow = change_of(velocity, none)
    jumped = turned @ linear.jump.T
    early = order.sorted(crossing.early[:c])

    def one(each: Any) -> Any:
        family, second, size, start_force, forcing, bend_force, early_own = each
        shift = flow_part(family)
        begun = carried(family - shift * velocity, forcing * size)
        rate = change_of(family, start_force * size)
        soon = early @ begun[2] + early_own * size
        ends = []
        for v in range(count):
            shifted = shifts[v] * shift * flow - shifts[v] * rate - shift * rates[v]
            bent = (bends[:, v, :, :c] @ begun[..., None])[..., 0] + bend_force[v] * size
            end = carried(second[v] + shifted, bent)[2]
            ends.append(jnp.concatenate([end[:d], end[d:] + jumped[v] * soon]))
        return begun[2], jnp.stack(ends)

    by_parameter = jnp.moveaxis(linear.by_parameter, -1, 0)
    own = jnp.moveaxis(bends[..., c:], (3, 1), (0, 1))
    items = (before.family, before.second, sizes, linear.at_start[:, c:].T, by_parameter, own)
    family, second = jax.lax.map(one, (*items, crossing.early[c:]))
    return Tangents(turned, family, second)
