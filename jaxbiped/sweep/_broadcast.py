"""Broadcasting of one value to many starts."""

from typing import Any

import jax.tree_util as jtu
import numpy as np


def broadcast_leaves(tree: Any, count: int) -> Any:
    """The tree with every leaf repeated along a new first axis, without copies of it."""

    def repeat(leaf: Any) -> np.ndarray:
        array = np.asarray(leaf, dtype=np.float64)
        return np.broadcast_to(array, (count, *array.shape))

    return jtu.tree_map(repeat, tree)
