"""Broadcasting of one value to many starts."""

import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree


def broadcast_leaves(tree: PyTree, count: int) -> PyTree:
    """The tree with every leaf repeated along a new first axis, without copies of it."""

    def repeat(leaf: npt.ArrayLike) -> np.ndarray:
        array = np.asarray(leaf, dtype=np.float64)
        return np.broadcast_to(array, (count, *array.shape))

    return jtu.tree_map(repeat, tree)
