"""Collocated step: the vector field about one known step by Radau IIA.

Points lie evenly in the root of the time since the last switch: after a switch second derivatives
of the rates may be as singular as the inverse root of that time (Hertz's law after touchdown); in
the root itself the motion is smooth. Components whose rate is a component are eliminated by hand.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.5, order five.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.compiler import jacobian
from jaxbiped.linalg._small_matrices import BlockFactors, factorise
from jaxbiped.solve.controllers._switch_locator import MARGIN
from jaxbiped.solve.rosenbrock._linearisation import linearise
from jaxbiped.variational._flow import jump_of

_ROOT = 6.0**0.5
_NODES = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
RADAU = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)
"""Weights of the rates at the nodes."""
Field = Callable[[Sequence[Scalar], Sequence[Scalar]], list[Scalar]]
"""Rates of all components, of components and active parameters."""


class KnownStep(NamedTuple):
    """A step of a solved motion.

    Attributes:
        before, after: states where it starts and ends, shape (c,).
        start, span: time of its start and duration [s].
        switched: time of the last switch before it [s].
        fresh: whether it starts on a switch.
        crossed: whether it ends on one.
    """

    before: Scalar
    after: Scalar
    start: Scalar
    span: Scalar
    switched: Scalar
    fresh: Scalar
    crossed: Scalar

    def clock(self) -> tuple[Scalar, Scalar]:
        """Of the collocation points: the part of the step before each, and its share of time, (3,).

        A share is the derivative of time in the step's own variable, which runs evenly in the root
        of the time since the last switch.
        """
        since = self.start - self.switched
        first, last = jnp.sqrt(since), jnp.sqrt(since + self.span)
        width = jnp.where(self.span > 0.0, self.span / (first + last), 0.0)
        root = first + width * _NODES
        elapsed = width * _NODES * (root + first)
        return elapsed / jnp.where(self.span > 0.0, self.span, 1.0), 2.0 * root * width


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

    def sorted(self, vector: Scalar) -> Scalar:
        """The last axis of an array in this order."""
        return jnp.stack([vector[..., i] for i in self.every], axis=-1)

    def restored(self, vector: Scalar) -> Scalar:
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
        by_direct: Jacobian of the kept rates in the d direct components there, (3, k, d).
        factors: of the equations of the kept components at all points, 3 k of them.
    """

    order: Order
    weights: Scalar
    by_direct: Scalar
    factors: BlockFactors

    @staticmethod
    def of(order: Order, share: Scalar, jacobians: Scalar) -> "Stages":
        """From the Jacobians of the kept rates, (3, k, c), their columns in order."""
        weights = cast(Scalar, RADAU * share)
        d, k = order.direct, len(order.kept)
        by_direct, by_kept = jacobians[..., :d], jacobians[..., d:]
        # A direct component follows its rate: the equation of a second derivative.
        twice = weights[:, :, None] * weights
        follows = jnp.concatenate([by_direct, jnp.zeros((3, k, k - d))], axis=-1)

        def column(each: tuple[Scalar, ...]) -> Scalar:
            unit, own, follows = each
            blocks = weights[:, :, None] * own + jnp.einsum("ijl,jk->ilk", twice, follows)
            return jnp.eye(3)[..., None] * unit - blocks

        columns = jnp.eye(k), jnp.moveaxis(by_kept, -1, 0), jnp.moveaxis(follows, -1, 0)
        return Stages(order, weights, by_direct, factorise(jax.lax.map(column, columns)))

    def solve(self, right: Scalar, forcing: Scalar) -> Scalar:
        """u of (I − A ⊗ J) u = r + (A ⊗ I) b, shape (3, c); r (3, c), b of the kept (3, k)."""
        d = self.order.direct
        direct, kept = right[:, :d], right[:, d:]
        pushed = forcing + (self.by_direct @ direct[..., None])[..., 0] if d else forcing
        found = self.factors.solve((kept + self.weights @ pushed).reshape(-1)).reshape(3, -1)
        if not d:
            return found
        return jnp.concatenate([direct + self.weights @ found[:, :d], found], axis=1)

    def carried(self, tangents: Scalar) -> Scalar:
        """Tangents at the points, (v, 3, c), of those where the step starts, (v, c)."""
        unforced = jnp.zeros((3, len(self.order.kept)))
        every = [self.solve(jnp.stack([start] * 3), unforced) for start in tangents]
        return jnp.stack(every) if every else jnp.zeros((0, 3, len(self.order.every)))

    def pulled(self, u: Scalar) -> tuple[Scalar, Scalar]:
        """Derivatives of a sum of u with respect to r, one vector for all points, and to b.

        Args:
            u: weights in the sum, (3, c).

        Returns:
            Shapes (c,) and (3, k).
        """
        d = self.order.direct
        direct, found = u[:, :d], u[:, d:]
        if d:
            follows = self.weights.T @ direct
            found = found + jnp.concatenate([follows, jnp.zeros_like(found[:, d:])], axis=1)
        kept = self.factors.solve_transposed(found.reshape(-1)).reshape(3, -1)
        forcing = self.weights.T @ kept
        by_kept = jnp.sum(kept, axis=0)
        if not d:
            return by_kept, forcing
        by_direct = jnp.sum(direct, axis=0) + jnp.einsum("jkd,jk->d", self.by_direct, forcing)
        return jnp.concatenate([by_direct, by_kept]), forcing


class Rows:
    """Rates and their derivatives at one point, of `field` for components in this `order`.

    A step that ends on a switch belongs to the side that lies a `margin` [s] before.
    """

    def __init__(
        self, field: Field, order: Order, parameters: Sequence[Scalar], margin: float = MARGIN
    ) -> None:
        self.field, self.order, self.parameters = field, order, list(parameters)
        self.margin = margin
        # Compiled by themselves, these are traced once, not at each use.
        self.by_state, self.curved = jax.jit(self._by_state), jax.jit(self._curved)

    def velocity(self, y: Scalar) -> Scalar:
        return jnp.stack(self.field(list(y), self.parameters))

    def _by_state(self, y: Scalar) -> Scalar:
        """Derivatives of the kept rates with respect to the components, (k, c)."""
        return self.order.sorted(jacobian(lambda z: self._kept(z, self.parameters), list(y)))

    def gradient(self, y: Scalar) -> Scalar:
        """Derivatives of the kept rates, (k, n)."""
        return self._by_all(self._kept, list(y))

    def _curved(self, y: Scalar, along: Scalar, weights: Scalar) -> Scalar:
        """Derivatives of a sum of the kept rates' derivatives along a tangent of the state, (n,).

        The tangent (c,), in the components' own order, and weights (k,).
        """

        def directional_derivative(y: list[Scalar], q: list[Scalar]) -> list[Scalar]:
            changes = jax.jvp(lambda y: self._kept(y, q), (y,), (list(along),))[1]
            parts = [weight * change for weight, change in zip(weights, changes, strict=True)]
            return [sum(parts[1:], parts[0])]

        return self._by_all(directional_derivative, list(y))[0]

    def forced(self, y: Scalar, weights: Scalar) -> Scalar:
        """Derivatives of a sum of the kept rates with respect to the parameters, (p,)."""

        def total(parameters: list[Scalar]) -> Scalar:
            return weights @ jnp.stack(self._kept(list(y), parameters))

        slopes = jax.grad(total)(self.parameters)
        return jnp.stack(slopes) if slopes else jnp.zeros(0)

    def _kept(self, y: list[Scalar], q: list[Scalar]) -> list[Scalar]:
        every = self.field(y, q)
        return [every[i] for i in self.order.kept]

    def _by_all(self, function: Callable[..., list[Scalar]], y: list[Scalar]) -> Scalar:
        c = len(y)
        found = jacobian(lambda z: function(z[:c], z[c:]), [*y, *self.parameters])
        return jnp.concatenate([self.order.sorted(found[:, :c]), found[:, c:]], axis=1)


class Linear(NamedTuple):
    """The field about one step, all in order; n = c + p.

    Attributes:
        stages: the step's equations.
        points: states at the collocation points, (3, c), in the components' own order.
        by_parameter: derivatives of the kept rates there, (3, k, p).
        at_start: of the kept rates with respect to all where the step starts, (k, n).
        velocity: rates there, (c,).
        jump: of their derivatives with respect to the components where the step ends, (k, c).
    """

    stages: Stages
    points: Scalar
    by_parameter: Scalar
    at_start: Scalar
    velocity: Scalar
    jump: Scalar


def collocate_step(rows: Rows, step: KnownStep) -> tuple[Scalar, Scalar, Scalar]:
    """A step's collocation points, (3, c), in the components' own order.

    Also their shares of time, (3,), and the rates where it begins.
    """
    part, share = step.clock()
    begins, ends = rows.velocity(step.before), rows.velocity(step.after)
    points = _correct(rows, step, part, share, begins, ends)
    # A step that ends on a switch belongs to the old side; a corrected point may lie beyond.
    short = jnp.where(step.crossed, step.after - rows.margin * ends, points[2])
    return jnp.concatenate([points[:2], short[None]]), share, begins


def linearise_about(
    rows: Rows,
    before: Scalar,
    after: Scalar,
    points: Scalar,
    share: Scalar,
    crossed: Scalar,
    sides: Scalar,
) -> Linear:
    """The field about a step between two states, whose `points` and shares are known.

    If it ends on a switch, the Jacobian's jump there is told by its values at the times `sides`.
    """
    order = rows.order
    c = len(order.every)
    found = jax.lax.map(rows.gradient, jnp.concatenate([points, before[None]]))
    stages = Stages.of(order, share, found[:3, :, :c])

    def jump() -> Scalar:
        states = after + sides[:, None] * rows.velocity(after)
        return jump_of(jax.lax.map(rows.by_state, states))

    jumps = jax.lax.cond(crossed, jump, lambda: jnp.zeros_like(found[3, :, :c]))
    return Linear(
        stages, points, found[:3, :, c:], found[3], order.sorted(rows.velocity(before)), jumps
    )


def _correct(
    rows: Rows, step: KnownStep, part: Scalar, share: Scalar, begins: Scalar, ends: Scalar
) -> Scalar:
    """The collocation points: a cubic, once corrected."""
    order = rows.order
    h, change = step.span, step.after - step.before
    start, end = h * begins, h * ends
    second, third = 3.0 * change - 2.0 * start - end, start + end - 2.0 * change
    s = part[:, None]
    points = step.before + s * (start + s * (second + s * third))
    velocities, found = jax.lax.map(lambda y: (rows.velocity(y), rows.by_state(y)), points)
    stages = Stages.of(order, share, found)
    residual = order.sorted(points - step.before - (RADAU * share) @ velocities)
    unforced = jnp.zeros((3, len(order.kept)))
    return points - order.restored(stages.solve(residual, unforced))
