"""Pushes off a gait that a rigid walker's mode admits: what is held stays so, no stop is passed."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._types import Scalar, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._holds import on_held
from jaxbiped.dynamics._mode_changes import SLACK
from jaxbiped.dynamics._state_quantities import recurring_leaves, recurring_names
from jaxbiped.scene._couplings import angles_and_rates_named
from jaxbiped.scene._modes import Limit
from jaxbiped.scene._rigid_feet import rigid_modes
from jaxbiped.scene._scene import RigidScene


def projection_of(scene: Any, state: Any) -> np.ndarray:
    """Projection of the m recurring components on those that may change, shape (m, m).

    The identity where nothing is held.
    """
    if scene.compliant or not rigid_modes(scene.mechanism).any:
        return np.eye(len(recurring_leaves(state)))
    return np.asarray(_projection(*jtu.tree_map(as_float, (scene, state))))


@cached_jit
def _projection(scene: RigidScene, state: Any) -> Scalar:
    leaves, structure = jtu.tree_flatten(state)

    def held(leaves: list[Scalar]) -> Scalar:
        there = on_held(scene, jtu.tree_unflatten(structure, leaves))
        return jnp.stack(recurring_leaves(there))

    slopes = jax.jacfwd(held)(leaves)
    return jnp.stack(recurring_leaves(jtu.tree_unflatten(structure, slopes)), axis=1)


def admissible_directions(scene: Any, state: Any, scales: np.ndarray) -> np.ndarray:
    """Orthonormal directions of scaled recurring components in which a state may move, (m, d)."""
    import scipy.linalg

    projection = projection_of(scene, state)
    if np.array_equal(projection, np.eye(len(projection))):
        return projection
    found: np.ndarray = scipy.linalg.orth(projection / scales[:, None])
    return found


def independent_names(scene: Any, state: Any) -> tuple[str, ...]:
    """Names of recurring components that may be chosen freely; what is held follows them."""
    projection = projection_of(scene, state)
    chosen: list[int] = []
    for k in range(len(projection)):
        if np.linalg.matrix_rank(projection[[*chosen, k]]) > len(chosen):
            chosen.append(k)
    return tuple(tuple(recurring_names(state))[k] for k in chosen)


def limit_motions(scene: Any, values: Mapping[str, Any]) -> list[tuple[Limit, Any, Any]]:
    """Each limit of a rigid walker's stops, how far it is [rad] and at what rate it goes away.

    Args:
        scene: the walker.
        values: scalars of its states by name, arrays of any common shape.
    """
    mechanism, slope = scene.mechanism, scene.ground.slope
    nothing = 0.0 * np.asarray(values[mechanism.structure.coordinates[2]])
    angles, rates = angles_and_rates_named(mechanism, slope, values, nothing)
    return [
        (limit, np.asarray(limit.distance(mechanism, angles, slope)), limit.gap.of(rates))
        for limit in rigid_modes(mechanism).limits
    ]


def passes_a_stop(scene: Any, values: Mapping[str, Any], *, by: float = SLACK) -> np.ndarray:
    """Whether states by name, arrays of shape (n,), lie beyond a stop by so much [rad]."""
    angle = scene.mechanism.structure.coordinates[2]
    passed = np.zeros(np.shape(values[angle]), dtype=bool)
    if not scene.compliant:
        for _, off, _ in limit_motions(scene, values):
            passed = passed | (off < -by)
    return passed
