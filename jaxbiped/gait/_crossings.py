"""Which switches the steps of a known motion end past, and what that does to second tangents."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._switches import Switch
from jaxbiped.gait._radau import Rates, stacked, velocities, with_seeds

SIDES = tuple(1e-10 * side for side in (1.0, 4.0, 16.0, -1.0, -4.0, -16.0))
"""When the two sides of a switch are looked at [s]: first the new one. Nearer, penetrations are all
rounding; a thousand times the margin away, Jacobians have changed by more than their jump's error.
"""


class Crossings(NamedTuple):
    """The switch that each step ends just past, if any; leaves of shape (steps,).

    No step is taken to cross two at once.

    Attributes:
        crossed: whether there is one.
        past: time from the switch to the step's end [s]; 0 where there is none.
        landed: states on the switch, or the steps' ends where there is none, shape (steps, c).
        early: how much earlier a change of components and parameters makes the crossing,
            shape (steps, c + p).
    """

    crossed: Scalar
    past: Scalar
    landed: Scalar
    early: Scalar


def crossings_of(
    rates: Rates,
    surfaces: Callable[[Scalar], Sequence[Switch]],
    before: Scalar,
    after: Scalar,
    parameters: Scalar,
) -> Crossings:
    """The crossings of many steps, from states `before` to states `after`, shape (steps, c)."""

    def one(before: Scalar, after: Scalar) -> Crossings:
        return crossing_of(rates, surfaces, before, after, parameters)

    return jax.vmap(one)(before, after)


def crossing_of(
    rates: Rates,
    surfaces: Callable[[Scalar], Sequence[Switch]],
    before: Scalar,
    after: Scalar,
    parameters: Scalar,
) -> Crossings:
    """The crossing of one step: the first in the switches' order, where there are several."""
    old, new = (jnp.concatenate([y, parameters]) for y in (before, after))
    idle = jnp.zeros_like(parameters)

    def values(z: Scalar) -> list[Scalar]:
        return [surface.value for surface in surfaces(z)]

    def live(z: Scalar) -> list[Any]:
        return [surface.live for surface in surfaces(z)]

    def rate(z: Scalar) -> Scalar:
        return jnp.concatenate([stacked(rates)(z), idle])

    velocity = rate(new)
    beyond, slopes = jax.jvp(values, (new,), (velocity,))
    changed = [(a > 0.0) != (b > 0.0) for a, b in zip(values(old), beyond, strict=True)]
    found, chosen = jnp.asarray(False), []
    for change, was, is_ in zip(changed, live(old), live(new), strict=True):
        chosen.append(change & (was | is_) & ~found)
        found = found | chosen[-1]

    def picked(each: Sequence[Scalar], value: Any) -> Scalar:
        for here, candidate in zip(chosen, each, strict=True):
            value = jnp.where(here, candidate, value)
        return value

    def back(past: Scalar) -> Scalar:
        return new - past * rate(new - 0.5 * past * velocity)

    def crossed() -> tuple[Scalar, Scalar, Scalar]:
        slope = picked(slopes, 1.0)
        first = picked(beyond, 0.0) / slope
        # The switch's rate changes fast: once more from there.
        past = first + picked(values(back(first)), 0.0) / slope
        z = back(past)
        rows = jax.jacrev(lambda z: jnp.stack([jnp.zeros(()), *values(z)]))(z)
        gradient = picked(list(rows[1:]), jnp.zeros_like(z))
        return past, z, gradient / jnp.where(found, gradient @ rate(z), 1.0)

    def not_crossed() -> tuple[Scalar, Scalar, Scalar]:
        return jnp.zeros(()), new, jnp.zeros_like(new)

    past, z, early = jax.lax.cond(found, crossed, not_crossed)
    return Crossings(found, past, z[: after.shape[0]], early)


def sides_of(rates: Rates, crossings: Crossings, parameters: Scalar) -> Scalar:
    """Points on the new and then the old side of each crossing, shape (steps, 6, c)."""
    speed = velocities(rates, crossings.landed, parameters)
    away = jnp.array(SIDES)
    return crossings.landed[:, None] + away[:, None] * speed[:, None]


def jump_of(at_sides: Scalar) -> Scalar:
    """J₊ − J₋ from its values at `sides_of`, shape (steps, c, c + p).

    Extrapolated to the switch itself, in the root of time: that is how Hertz's law leaves it.
    """
    new, old = (
        8.0 * at_sides[:, k] - 6.0 * at_sides[:, k + 1] + at_sides[:, k + 2] for k in (0, 3)
    )
    return (new - old) / 3.0


def bent_by(
    jump: Scalar, crossings: Crossings, firsts: Scalar, seeds: Scalar, count: int
) -> Scalar:
    """Jumps of C at the end of each step, shape (steps, c, q, v); zero where none is crossed."""
    moved = with_seeds(firsts, seeds)
    early = jnp.einsum("sz,szq->sq", crossings.early, moved[..., count:])
    return jnp.einsum("scv,sq->scqv", jump @ moved[..., :count], early)
