"""Switch crossings of a known motion, and their effect on the second variation."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.dynamics._switches import Switch
from jaxbiped.variational._radau_collocation import Rates, stack_rates, velocities, with_seeds

SIDES = tuple(1e-10 * side for side in (1.0, 4.0, 16.0, -1.0, -4.0, -16.0))
"""When the two sides of a switch are looked at [s]: first the new one. Nearer, penetrations are all
rounding; a thousand times the margin away, Jacobians have changed by more than their jump's error.
"""


class Crossings(NamedTuple):
    """The switch that each step ends just past, if any; leaves of shape (steps,).

    No step is taken to cross two at once.

    Attributes:
        which: its number, counted from one; 0 where there is none.
        past: time from the switch to the step's end [s]; 0 where there is none.
        landed: states on the switch, or the steps' ends where there is none, shape (steps, c).
    """

    which: Scalar
    past: Scalar
    landed: Scalar

    @property
    def crossed(self) -> Scalar:
        """Whether there is one."""
        return self.which > 0


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
    rate = _rate(rates, parameters)

    def values(z: Scalar) -> list[Scalar]:
        return [surface.value for surface in surfaces(z)]

    def live(z: Scalar) -> list[Scalar | bool]:
        return [surface.live for surface in surfaces(z)]

    velocity = rate(new)
    beyond, slopes = jax.jvp(values, (new,), (velocity,))
    changed = [(a > 0.0) != (b > 0.0) for a, b in zip(values(old), beyond, strict=True)]
    which = jnp.asarray(0)
    for number, (change, was, is_) in enumerate(zip(changed, live(old), live(new), strict=True)):
        which = jnp.where(change & (was | is_) & (which == 0), 1 + number, which)

    def back(past: Scalar) -> Scalar:
        return new - past * rate(new - 0.5 * past * velocity)

    def crossed() -> tuple[Scalar, Scalar]:
        slope = _pick(which, slopes, 1.0)
        first = _pick(which, beyond, 0.0) / slope
        # The switch's rate changes fast: once more from there.
        past = first + _pick(which, values(back(first)), 0.0) / slope
        return past, back(past)

    past, z = jax.lax.cond(which > 0, crossed, lambda: (jnp.zeros(()), new))
    return Crossings(which, past, z[: after.shape[0]])


def earlier_at(
    rates: Rates,
    surfaces: Callable[[Scalar], Sequence[Switch]],
    landed: Scalar,
    which: Scalar,
    parameters: Scalar,
) -> Scalar:
    """How much earlier a change of components and parameters makes a crossing, shape (c + p,).

    Of the switch of number `which` at `landed`; zeros where there is none.
    """
    z = jnp.concatenate([landed, parameters])

    def values(z: Scalar) -> Scalar:
        return jnp.stack([jnp.zeros(()), *(surface.value for surface in surfaces(z))])

    gradient = _pick(which, list(jax.jacrev(values)(z)[1:]), jnp.zeros_like(z))
    return gradient / jnp.where(which > 0, gradient @ _rate(rates, parameters)(z), 1.0)


def _rate(rates: Rates, parameters: Scalar) -> Callable[[Scalar], Scalar]:
    """The rate of components and parameters, which do not change."""
    return lambda z: jnp.concatenate([stack_rates(rates)(z), jnp.zeros_like(parameters)])


def _pick(which: Scalar, each: Sequence[Scalar], value: Scalar | float) -> Scalar:
    """That of the switch of this number, or `value` where there is none."""
    for number, candidate in enumerate(each):
        value = jnp.where(which == 1 + number, candidate, value)
    return cast(Scalar, value)


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


def jet_jump(jump: Scalar, early: Scalar, firsts: Scalar, seeds: Scalar, count: int) -> Scalar:
    """Jumps of C at the end of each step, shape (steps, c, q, v), from its `earlier_at`."""
    seeded = with_seeds(firsts, seeds)
    times = jnp.einsum("sz,szq->sq", early, seeded[..., count:])
    return jnp.einsum("scv,sq->scqv", jump @ seeded[..., :count], times)
