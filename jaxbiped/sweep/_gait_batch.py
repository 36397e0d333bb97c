"""Batch of gaits: searches at many points of a grid at once, each in a lane."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._gait import Gait
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import AbstractScene

_FEW, _MANY = 16, 256
"""Searches in a batch: every size is a program that XLA compiles."""


def find_each(
    scene: AbstractScene,
    values: Mapping[str, np.ndarray],
    starts: np.ndarray,
    state: type,
    options: Mapping[str, Any],
) -> Iterator[tuple[slice, Gait]]:
    """The gaits that Newton's method comes to, part by part.

    Args:
        scene: the walker.
        values: of the parameters that differ, shape (n,) each.
        starts: states without hip_x, shape (n, m).
        state: their type.
        options: those of `find_gait`.

    Yields:
        Which of the n, and their gaits, every array of NumPy with a first axis; no orbits.
    """
    count, first = len(starts), 0
    scene = jtu.tree_map(as_float, scene)
    while first < count:
        size = _MANY if count - first > 3 * _FEW else _FEW
        part = slice(first, min(first + size, count))
        missing = size - (part.stop - first)
        # A search from nowhere ends at once: it fills the batch.
        rows = np.pad(starts[part], ((0, missing), (0, 0)), constant_values=np.nan)
        columns = {k: np.pad(v[part], (0, missing), mode="edge") for k, v in values.items()}
        begin = state(np.zeros(size), *np.ascontiguousarray(rows.T))
        gaits = _find_each(scene, columns, begin, dict(options))
        kept = part.stop - first
        yield part, jtu.tree_map(lambda leaf, kept=kept: np.asarray(leaf)[:kept], gaits)
        first = part.stop


@cached_jit
def _find_each(
    scene: AbstractScene, values: dict[str, np.ndarray], starts: PyTree, options: dict[str, Any]
) -> Gait:
    def one(values: dict[str, np.ndarray], start: PyTree) -> Gait:
        own = jtu.tree_map(jnp.asarray, with_parameters(scene, values))
        # Times and states of all steps would take more memory than all else.
        gait = find_gait(own, start, **options)
        return dataclasses.replace(gait, orbit=None)  # type: ignore[arg-type]

    return jax.vmap(one)(values, starts)
