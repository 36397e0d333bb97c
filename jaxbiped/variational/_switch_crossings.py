"""Switch crossing of a known step: where it lies, and what moves it."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.variational._flow import Flow

SIDES = tuple(1e-10 * side for side in (1.0, 4.0, 16.0, -1.0, -4.0, -16.0))
"""When the two sides of a switch are looked at [s]: first the new one. Nearer, penetrations are all
rounding; a thousand times the margin away, Jacobians have changed by more than their jump's error.
"""


class Crossing(NamedTuple):
    """The switch that a step ends just past, if any. No step is taken to cross two at once.

    Attributes:
        which: its number, counted from one; 0 where there is none.
        past: time from the switch to the step's end [s]; 0 where there is none.
        landed: the state on the switch, or the step's end where there is none, shape (c,).
    """

    which: Scalar
    past: Scalar
    landed: Scalar

    @property
    def crossed(self) -> Scalar:
        """Whether there is one."""
        return self.which > 0


def crossing_of(flow: Flow, before: Scalar, after: Scalar, parameters: Scalar) -> Crossing:
    """The crossing of one step: the first in the switches' order, where there are several."""
    old, new = (jnp.concatenate([y, parameters]) for y in (before, after))
    rate = _rate(flow, parameters)

    def values(z: Scalar) -> list[Scalar]:
        return [surface.value for surface in flow.surfaces(z)]

    def live(z: Scalar) -> list[Scalar | bool]:
        return [surface.live for surface in flow.surfaces(z)]

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
    return Crossing(which, past, z[: after.shape[0]])


def earlier_at(flow: Flow, landed: Scalar, which: Scalar, parameters: Scalar) -> Scalar:
    """How much earlier a change of components and parameters makes a crossing, shape (c + p,).

    Of the switch of number `which` at `landed`; zeros where there is none.
    """
    z = jnp.concatenate([landed, parameters])

    def values(z: Scalar) -> Scalar:
        return jnp.stack([jnp.zeros(()), *(surface.value for surface in flow.surfaces(z))])

    gradient = _pick(which, list(jax.jacrev(values)(z)[1:]), jnp.zeros_like(z))
    return gradient / jnp.where(which > 0, gradient @ _rate(flow, parameters)(z), 1.0)


def _rate(flow: Flow, parameters: Scalar) -> Callable[[Scalar], Scalar]:
    """The rate of components and parameters, which do not change."""
    return lambda z: jnp.concatenate([flow.velocity(z), jnp.zeros_like(parameters)])


def _pick(which: Scalar, each: Sequence[Scalar], value: Scalar | float) -> Scalar:
    """That of the switch of this number, or `value` where there is none."""
    for number, candidate in enumerate(each):
        value = jnp.where(which == 1 + number, candidate, value)
    return cast(Scalar, value)


def jump_of(at_sides: Scalar) -> Scalar:
    """J₊ − J₋ from its values on the `SIDES` of a switch, shape (c, n).

    Extrapolated to the switch itself, in the root of time: that is how Hertz's law leaves it.
    """
    new, old = (8.0 * at_sides[k] - 6.0 * at_sides[k + 1] + at_sides[k + 2] for k in (0, 3))
    return (new - old) / 3.0
