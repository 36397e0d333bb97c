"""Directions in which a state may move while everything that is held stays so."""

from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._types import Scalar, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import recurring_leaves, recurring_names
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import is_compliant, is_rigid


def projection_of(scene: Any, state: Any) -> np.ndarray:
    """Projection of the m recurring components on those that may change, shape (m, m).

    The identity where nothing is held.
    """
    if is_compliant(scene) or (is_rigid(scene) and not rigid_modes(scene.mechanism).any):
        return np.eye(len(recurring_leaves(state)))
    return np.asarray(_projection(*jtu.tree_map(as_float, (scene, state))))


@cached_jit
def _projection(scene: Any, state: Any) -> Scalar:
    leaves, structure = jtu.tree_flatten(state)

    def held(leaves: list[Scalar]) -> Scalar:
        there = system_of(scene).on_held(scene, jtu.tree_unflatten(structure, leaves))
        return jnp.stack(recurring_leaves(there))

    slopes = jax.jacfwd(held)(leaves)
    return jnp.stack(recurring_leaves(jtu.tree_unflatten(structure, slopes)), axis=1)


def admissible_directions(scene: Any, state: Any, scales: np.ndarray) -> np.ndarray:
    """Orthonormal directions of scaled recurring components in which a state may move, (m, d)."""
    import scipy.linalg

    projection = projection_of(scene, state)
    if np.array_equal(projection, np.eye(len(projection))):
        return projection
    return scipy.linalg.orth(projection / scales[:, None])


def independent_names(scene: Any, state: Any) -> tuple[str, ...]:
    """Names of recurring components that may be chosen freely; what is held follows them."""
    projection = projection_of(scene, state)
    chosen: list[int] = []
    for k in range(len(projection)):
        if np.linalg.matrix_rank(projection[[*chosen, k]]) > len(chosen):
            chosen.append(k)
    return tuple(tuple(recurring_names(state))[k] for k in chosen)
