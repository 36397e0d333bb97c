"""Key of a scene: a number by which a result knows the scene that it was computed with.

It is made of all the scene's numbers and of what the scene is made of, can be traced and batched,
and tells scenes apart of which any number differs by more than rounding.
"""

import hashlib
import json
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTreeDef

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._identity import identity
from jaxbiped._types import Scalar, as_array, is_traced
from jaxbiped.caching._caches import PROGRAMS, OfObjects, bounded_cache
from jaxbiped.scene._scene import RedundantScene, RigidScene, Scene
from jaxbiped.solve._trajectory import Trajectory

_ROUNDING = 1e2
"""Differences of keys that count as none, in units of the walk's precision."""


def scene_key(scene: Any) -> Scalar:
    """The key of a scene, shaped as its leaves; without derivatives."""
    leaves, structure = jtu.tree_flatten(scene)
    weights = _weights(structure)
    if is_traced(leaves):
        leaves = [jax.lax.stop_gradient(leaf) for leaf in leaves]
        return _sum(jnp, jnp.stack(jnp.broadcast_arrays(*map(jnp.asarray, leaves))), weights)
    # Kept as NumPy's: under `jit` an array of JAX's would be a tracer.
    return as_array(_KEYS(scene, lambda: _sum(np, np.stack(np.broadcast_arrays(*leaves)), weights)))


_KEYS = OfObjects[np.ndarray]()


def _sum(numpy: Any, values: Any, weights: np.ndarray) -> Any:
    zeros = (values == 0.0).astype(float)
    parts = (numpy.log(numpy.abs(values) + zeros), zeros, (values < 0.0).astype(float))
    return sum(numpy.tensordot(w, part, 1) for w, part in zip(weights, parts, strict=True))


def check_scene_of(trajectory: Any, scene: Any, name: str = "trajectory") -> None:
    """Raises `ArgumentError` for a scene other than the one that a motion was simulated with."""
    check_type("scene", scene, Scene, RedundantScene, RigidScene)
    check_type(name, trajectory, Trajectory)
    kept = trajectory.scene_key
    if kept is None:
        return
    own = scene_key(scene)
    if is_traced((own, kept)):
        return
    near = _ROUNDING * np.finfo(trajectory.t.dtype).eps * (1.0 + np.abs(kept))
    if np.any(np.abs(np.asarray(own) - np.asarray(kept)) > near):
        raise ArgumentError(
            f"scene is not allowed: the {name} was simulated with another one; give that one, or "
            "simulate this one."
        )


@bounded_cache(PROGRAMS)
def _weights(structure: PyTreeDef) -> np.ndarray:
    """Random numbers of each leaf, others for every structure: its weight, and two for its sign.

    Shape (3, leaves).
    """
    numbered = jtu.tree_unflatten(structure, range(structure.num_leaves))
    told = json.dumps(identity(numbered), sort_keys=True)
    seed = int.from_bytes(hashlib.sha256(told.encode()).digest()[:8], "big")
    return np.random.default_rng(seed).uniform(1.0, 2.0, (3, structure.num_leaves))
