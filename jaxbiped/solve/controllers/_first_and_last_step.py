"""First and last steps of a solve: their sizes, and how they meet its end as in diffrax."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Numbers, RealScalarLike, Scalar
from jaxbiped.caching._cached_jit import cached_jit

_FIRST_STEP = 1e-5
"""First step tried, in units of time; a start that is not a number must not choose it."""
_CLIPPED_ULPS = 100
"""A step that would end this near the end, in units in the last place, ends there."""


def first_step(duration: Numbers, time_unit: RealScalarLike = 1.0) -> Scalar:
    """The first step to try [s] in a solve of at most `duration` [s]."""
    return jnp.minimum(jnp.full_like(duration, _FIRST_STEP) * time_unit, duration)


@cached_jit  # many small operations
def just_before_end(duration: Numbers) -> Scalar:
    """The time such that a step that would end at or after it ends at `duration`, as in diffrax.

    Units are counted in the bits of the 64-bit number, which have the numbers' own order: the same
    count of steps to the preceding number would take XLA seconds to compile.
    """
    bits = jax.lax.bitcast_convert_type(duration, jnp.int64)
    below = jnp.where(duration > 0.0, bits - _CLIPPED_ULPS, bits + _CLIPPED_ULPS)
    # Numbers below the least normal one count for none.
    nothing = -np.finfo(np.float64).tiny * (1.0 + (_CLIPPED_ULPS - 1) * np.finfo(np.float64).eps)
    earlier = jax.lax.bitcast_convert_type(below, jnp.float64)
    return jnp.where(duration == 0.0, nothing, earlier)


def clip_step(
    keep: Scalar, t: Scalar, next_t: Scalar, end: Numbers, almost_end: Numbers
) -> tuple[Scalar, Scalar]:
    """The times at which the next step begins and ends, when it comes near `end`."""
    t = jnp.minimum(t, end)
    last = jnp.where(keep, end, t + 0.5 * (end - t))
    return t, jnp.where(next_t > almost_end, last, next_t)
