"""Which switches the steps of a known motion end past, and what that does to second tangents."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._switches import Switch
from jaxbiped.gait._radau import Rates, gradients, with_seeds

_MARGIN, _SHARE = 1e-12, 1e-3
"""Least time from a switch [s], and least share of a step's overshoot, at which its sides are
looked at: far enough to be sure of the side, near enough that only the jump is seen."""


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


def crossings_of(
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


def jumps_of(
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
    new, old, further, older = jnp.moveaxis(gradients(rates, points, parameters), 1, 0)
    # Extrapolated to the switch itself: the Jacobian varies fast on either side.
    jump = 2.0 * (new - old) - (further - older)
    moved = with_seeds(firsts, seeds)
    early = jnp.einsum("sz,szq->sq", crossings.early, moved[..., count:])
    return jnp.einsum("scv,sq->scqv", jump @ moved[..., :count], early)
