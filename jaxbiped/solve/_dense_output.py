"""Dense output: states between the steps of a solve, compiled once whatever its length."""

from collections.abc import Callable

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit

AT_ONCE = 4096
"""Times or states in one call of a compiled function: one size for all lengths."""


def split_evenly(values: np.ndarray) -> list[np.ndarray]:
    """Values of shape (n,) in parts of one size, the last one filled up; of none, one part."""
    if not len(values):
        return [np.zeros(AT_ONCE)]
    missing = -len(values) % AT_ONCE
    return list(np.pad(values, (0, missing), mode="edge").reshape(-1, AT_ONCE))


def join_parts(found: list[PyTree], size: int) -> PyTree:
    """What was found for each part, one behind the other, as NumPy arrays of shape (size,)."""
    return jtu.tree_map(lambda *leaves: np.concatenate(leaves)[:size], *jax.device_get(found))


def evaluate_dense(dense: diffrax.DenseInterpolation, times: np.ndarray) -> PyTree:
    """States at times of shape (n,), as NumPy arrays; NaN before the start and after the end.

    As `dense.evaluate` gives them, for a solve of at least one step.
    """
    ends = np.asarray(dense.ts)[: int(dense.ts_size)]
    infos = jtu.tree_map(np.asarray, dense.infos)
    inside = np.where((times >= ends[0]) & (times <= ends[-1]), times, np.nan)
    found = []
    for part in split_evenly(inside):
        # A time at a step's end is the end of that step; NaN is behind all of them.
        step = np.clip(np.searchsorted(ends, part) - 1, 0, len(ends) - 2)
        info = jtu.tree_map(lambda leaf, step=step: leaf[step], infos)
        found.append(_evaluate(dense.interpolation_cls, ends[step], ends[step + 1], info, part))
    return join_parts(found, len(times))


@cached_jit
def _evaluate(
    kind: Callable[..., diffrax.AbstractLocalInterpolation],
    start: np.ndarray,
    end: np.ndarray,
    info: PyTree,
    t: np.ndarray,
) -> PyTree:
    def evaluate(start: Scalar, end: Scalar, info: PyTree, t: Scalar) -> PyTree:
        return kind(t0=start, t1=end, **info).evaluate(t)

    return jax.vmap(evaluate)(*jtu.tree_map(jnp.asarray, (start, end, info, t)))
