"""Saved times of a simulation."""

import jax
import numpy as np
from jaxtyping import ArrayLike

from jaxbiped._checks import ArgumentError
from jaxbiped._types import Scalar


def check_times(times: ArrayLike, duration: Scalar | float) -> None:
    """Raises `ArgumentError` unless they increase and lie within the duration [s]."""
    if isinstance(times, jax.core.Tracer) or isinstance(duration, jax.core.Tracer):
        return
    try:
        values = np.asarray(times, dtype=float)
    except (TypeError, ValueError):
        raise ArgumentError(
            f'save = {times!r} is not allowed: give "steps", "end", a section or increasing times.'
        ) from None
    allowed = values.ndim == 1 and np.all(np.diff(values) >= 0.0)
    if not allowed or not np.all((values >= 0.0) & (values <= float(duration))):
        raise ArgumentError(
            f"save = {values} is not allowed: it must be increasing times from 0 to {duration} s."
        )
