"""Radau IIA collocation over known steps, many at once.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.5, order five.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.solve._fusion_barrier import fusion_barrier

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
Rates = Callable[[Sequence[Scalar]], list[Scalar]]
"""Components and parameters, one by one, to the rates: pulling back through arrays of them makes
programs that compile for seconds."""


def stack_rates(rates: Rates) -> Callable[[Scalar], Scalar]:
    """The same of a vector (c + p,) to a vector (c,)."""
    return lambda z: jnp.stack(rates(list(z)))


def velocities(rates: Rates, states: Scalar, parameters: Scalar) -> Scalar:
    """The rates of many states (n, c), shape (n, c)."""
    return jax.vmap(lambda y: stack_rates(rates)(jnp.concatenate([y, parameters])))(states)


class Path(NamedTuple):
    """Consecutive steps of a solved motion, at most `CHUNK`; idle ones have no span.

    Attributes:
        before, after: states, shape (steps, c).
        start, span: times of their starts and their durations [s], shape (steps,).
        switched: time of the last switch before each [s].
        fresh: whether a step starts on a switch.
    """

    before: Scalar
    after: Scalar
    start: Scalar
    span: Scalar
    switched: Scalar
    fresh: Scalar

    def clock(self) -> tuple[Scalar, Scalar]:
        """Of the collocation points: the part of the step before each, and its share of time.

        Both of shape (steps, 3). A share is the derivative of time in the step's own variable,
        which runs evenly in the root of the time since the last switch.
        """
        since = self.start - self.switched
        first, last = jnp.sqrt(since), jnp.sqrt(since + self.span)
        width = jnp.where(self.span > 0.0, self.span / (first + last), 0.0)
        root = first[:, None] + width[:, None] * _NODES
        elapsed = width[:, None] * _NODES * (root + first[:, None])
        part = elapsed / jnp.where(self.span > 0.0, self.span, 1.0)[:, None]
        return part, 2.0 * root * width[:, None]


def collocation_points(rates: Rates, path: Path, parameters: Scalar) -> Scalar:
    """States at the collocation points, shape (steps, 3, c): a cubic, once corrected."""
    part, share = path.clock()
    h = path.span[:, None]
    start, end = (h * velocities(rates, y, parameters) for y in (path.before, path.after))
    change = path.after - path.before
    second, third = 3.0 * change - 2.0 * start - end, start + end - 2.0 * change
    s, before = part[..., None], path.before[:, None]
    points = before + s * (start[:, None] + s * (second[:, None] + s * third[:, None]))
    c = path.before.shape[1]
    slopes = share[..., None] * jax.vmap(lambda y: velocities(rates, y, parameters))(points)
    residual = points - before - jnp.einsum("ij,njc->nic", RADAU, slopes)
    matrix = _matrix(gradients(rates, points, parameters)[..., :c], share)
    correction = jnp.linalg.solve(matrix, residual.reshape(-1, 3 * c, 1))
    return points - correction.reshape(points.shape)


def gradients(
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
    constants = list(parameters)

    def pulls(y: Scalar, tangent: Scalar) -> PyTree:
        z = [*y, *constants]
        if along is None or along_parameters is None:
            return jax.vjp(rates, z)[1]
        whole = [*tangent, *along_parameters]
        return jax.vjp(lambda z: jax.jvp(rates, (z,), (whole,))[1], z)[1]

    flat = points.reshape(-1, size)
    tangents = flat if along is None else along.reshape(-1, size)
    moves = jnp.isfinite(jnp.sum(flat))
    every = fusion_barrier(moves, lambda: jax.vmap(pulls)(flat, tangents))

    def pulled() -> Scalar:
        def one(pull: Callable[[list[Scalar]], list[list[Scalar]]]) -> Scalar:
            return jax.vmap(lambda e: jnp.stack(pull(list(e))[0]))(unit)

        # A linear field leaves nothing to pull through: the size is said, not read off.
        return jax.vmap(one, axis_size=flat.shape[0])(every)

    rows = fusion_barrier(moves, pulled)
    return rows.reshape(*points.shape, size + parameters.shape[0])


class Collocation(NamedTuple):
    """Steps of the linear equation y' = J y + b, solved for what is linear in their starts.

    Attributes:
        inverse: (I − A ⊗ (share_j J_j))⁻¹, shape (steps, 3 c, 3 c).
        maps: derivatives of the stages in start and parameters, shape (steps, 3 c, c + p).
        share: derivative of time in the steps' own variable, shape (steps, 3).
    """

    inverse: Scalar
    maps: Scalar
    share: Scalar

    def steps(self) -> Scalar:
        """Ends by start and parameters, shape (steps, c, c + p)."""
        return self.maps[:, self.maps.shape[1] // 3 * 2 :]

    def within(self, firsts: Scalar, seeds: Scalar) -> Scalar:
        """Tangents at the collocation points, shape (steps, 3, c, n)."""
        found = self.maps @ with_seeds(firsts, seeds)
        return found.reshape(found.shape[0], 3, -1, found.shape[-1])

    def forced(self, forcing: Scalar) -> Scalar:
        """What a forcing (steps, 3, c, n) adds to the ends, shape (steps, c, n)."""
        found = self.inverse @ _spread(forcing, self.share)
        return found[:, found.shape[1] // 3 * 2 :]


def collocation(path: Path, jacobians: Scalar) -> Collocation:
    """Steps whose Jacobians at the collocation points, (steps, 3, c, c + p), are given."""
    _, share = path.clock()
    steps, _, c, _ = jacobians.shape
    inverse = jnp.linalg.inv(_matrix(jacobians[..., :c], share))
    starts = jnp.broadcast_to(jnp.tile(jnp.eye(c), (3, 1)), (steps, 3 * c, c))
    forcing = _spread(jacobians[..., c:], share)
    return Collocation(inverse, inverse @ jnp.concatenate([starts, forcing], axis=-1), share)


def _matrix(jacobians: Scalar, share: Scalar) -> Scalar:
    """I − A ⊗ (share_j J_j), shape (steps, 3 c, 3 c)."""
    steps, _, c, _ = jacobians.shape
    blocks = jnp.einsum("ij,njab->niajb", RADAU, share[..., None, None] * jacobians)
    return jnp.eye(3 * c) - blocks.reshape(steps, 3 * c, 3 * c)


def _spread(forcing: Scalar, share: Scalar) -> Scalar:
    """(A ⊗ I) (share_j b_j) of forcings (steps, 3, c, n), shape (steps, 3 c, n)."""
    steps, _, c, n = forcing.shape
    total = jnp.einsum("ij,njab->niab", RADAU, share[..., None, None] * forcing)
    return total.reshape(steps, 3 * c, n)


def with_seeds(tangents: Scalar, seeds: Scalar) -> Scalar:
    """Tangents (…, c, n) with those of the parameters (p, n) below them."""
    below = jnp.broadcast_to(seeds, (*tangents.shape[:-2], *seeds.shape))
    return jnp.concatenate([tangents, below], axis=-2)
