"""Arrival time: where a section's value rises through zero within a step."""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar

_SECANTS = 8
"""By which an arrival is located, to rounding."""


def arrival_time(value: Callable[[Scalar], Scalar], low: Scalar, high: Scalar) -> Scalar:
    """Where a function rises through zero between two times [s], by the Illinois method."""

    def secant(_: Scalar, now: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        a, b, at_a, at_b, side, _ = now
        rise = at_b - at_a
        middle = b - at_b * (b - a) / jnp.where(rise == 0.0, 1.0, rise)
        found = value(middle)
        left = found < 0.0
        # An end that stays twice counts half, so that it moves the next time.
        return (
            jnp.where(left, middle, a),
            jnp.where(left, b, middle),
            jnp.where(left, found, jnp.where(side > 0.0, 0.5 * at_a, at_a)),
            jnp.where(left, jnp.where(side < 0.0, 0.5 * at_b, at_b), found),
            jnp.where(left, -1.0, 1.0),
            middle,
        )

    start = (low, high, value(low), value(high), jnp.zeros_like(low), high)
    return jax.lax.fori_loop(0, _SECANTS, secant, start)[-1]
