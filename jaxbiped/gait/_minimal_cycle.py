"""Minimal cycle: the least number of footsteps after which an orbit closes.

The return map of n footsteps also has the gaits of every divisor of n as fixed points.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxbiped._types import RealScalarLike, Scalar, by_numpy
from jaxbiped.gait._fixed_point_search import Found
from jaxbiped.gait._poincare_map import LinearisedReturn

_ERRORS, _TOLERANCES = 4.0, 30.0
"""Distance of two crossings that are one: in units of the fixed point's error, and of rtol."""


def minimal_cycle(last: LinearisedReturn, error: Scalar, rtol: RealScalarLike) -> Scalar:
    """The least divisor k of n such that the crossing after k footsteps is the first one.

    Args:
        last: the n returns of the cycle, with their nodes.
        error: estimated errors of the m components that it begins at, shape (m,).
        rtol: the solve's relative tolerance.
    """
    crossings = crossings_of(last)
    n = crossings.shape[0]
    if n == 1:
        return jnp.asarray(1)

    def least(numpy: Any, crossings: Any, error: Any, rtol: Any) -> Any:
        allowed = _ERRORS * numpy.max(numpy.abs(error)) + _TOLERANCES * rtol
        found = numpy.asarray(n)
        for k in range(n - 1, 0, -1):
            if n % k == 0:
                off = numpy.max(numpy.abs(crossings[k] - crossings[0]))
                found = numpy.where(off <= allowed, k, found)
        return found

    return by_numpy(least, crossings, error, rtol)


def cycle_of(found: Found, rtol: float) -> int:
    """The same of a fixed point that is known, its error that of Newton's next correction."""
    last, m = found.last, found.recurring.shape[0]
    change = np.asarray(last.recurring) - np.asarray(crossings_of(last))[0]
    error, *_ = np.linalg.lstsq(np.eye(m) - np.asarray(last.jacobian)[:, :m], change)
    return int(minimal_cycle(last, error, rtol))


def crossings_of(last: LinearisedReturn) -> Scalar:
    """The m recurring components at the beginning of each of the n returns, shape (n, m)."""
    assert last.nodes is not None
    m = last.recurring.shape[0]
    # A row is time, hip_x and then all that must return.
    return last.nodes.start.reshape(-1, 2 + m)[:, 2:]
