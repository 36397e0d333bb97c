"""How the last steps of a solve meet its end, as diffrax has it."""

import equinox.internal as eqxi
import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar

_CLIPPED_ULPS = 100
"""A step that would end this near the end, in units in the last place, ends there."""


@jax.jit
def almost(duration: Scalar) -> Scalar:
    """The time from which on a step that would end there ends at `duration`, as diffrax has it."""
    for _ in range(_CLIPPED_ULPS):
        duration = eqxi.prevbefore(duration)
    return duration


def clipped(
    keep: Scalar, t: Scalar, next_t: Scalar, end: Scalar, almost_end: Scalar
) -> tuple[Scalar, Scalar]:
    """The times at which the next step begins and ends, once it comes near `end`."""
    t = jnp.minimum(t, end)
    last = jnp.where(keep, end, t + 0.5 * (end - t))
    return t, jnp.where(next_t > almost_end, last, next_t)
