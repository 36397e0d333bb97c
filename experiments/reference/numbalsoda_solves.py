"""Solves of the seed's walker by numbalsoda, many starts on all of numba's threads."""

import functools
import importlib.util
from collections.abc import Callable

import numpy as np

from .compliant import START, derivative, numbers


@functools.cache
def lsoda_address() -> int | None:
    """Address of the equations in numbalsoda's form; None where that is not installed."""
    if not all(importlib.util.find_spec(name) for name in ("numba", "numbalsoda")):
        return None
    import numba
    import numbalsoda

    seed = numbers()

    def rates(t, y, out, parameters):
        found = derivative(t, numba.carray(y, (8,)), seed)
        for i in range(8):
            out[i] = found[i]

    return numba.cfunc(numbalsoda.lsoda_sig)(rates).address


def lsoda(duration: float, rtol: float, atol: float) -> np.ndarray:
    """The final state of the seed's walk, by numbalsoda."""
    import numbalsoda

    times = np.array([0.0, duration])
    states, _ = numbalsoda.lsoda(lsoda_address(), START, times, rtol=rtol, atol=atol)
    return states[-1]


@functools.cache
def lsoda_batch(
    address: int | None = None,
) -> Callable[[np.ndarray, np.ndarray, float, float], np.ndarray]:
    """numbalsoda over many starts (n, k); gives final states (n, k).

    A lane that fails is not a number.

    Args:
        address: of the equations; those of the seed's walker unless given.
    """
    import numba
    from numbalsoda import lsoda as compiled_lsoda

    address = lsoda_address() if address is None else address

    @numba.njit(parallel=True)
    def batch(starts, times, rtol, atol):
        finals = np.empty_like(starts)
        for i in numba.prange(starts.shape[0]):
            states, done = compiled_lsoda(
                address, starts[i], times, np.array([0.0]), rtol, atol, 100000
            )
            finals[i] = states[-1] if done else np.full(starts.shape[1], np.nan)
        return finals

    return batch
