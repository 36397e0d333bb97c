"""Reading a trajectory between its steps: samples, integrals and moments of change."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import as_float
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._trajectory import Trajectory

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_BISECTIONS = 48


class Samples(NamedTuple):
    """A function of the state sampled on every interval of a trajectory, for integrals over it.

    Attributes:
        edges: ends of the intervals [s], shape (n + 1,).
        values: the function at the Gauss points, leaves of shape (n, 5).
    """

    edges: np.ndarray
    values: PyTree

    def integral(self, leaf: np.ndarray) -> np.ndarray:
        """Integral of a leaf of `values` over each interval, shape (n,)."""
        return np.asarray(np.diff(self.edges) * (leaf @ (0.5 * _WEIGHTS)))


def sampled(
    scene: Scene,
    trajectory: Trajectory,
    function: Callable[[Scene, State], PyTree],
    extra: np.ndarray,
) -> Samples:
    """Samples `function(scene, state)` between the solver's steps and the `extra` times [s]."""
    edges = np.unique(np.concatenate([np.asarray(trajectory.t), extra]))
    middles, halves = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    times = middles[:, None] + halves[:, None] * _NODES
    return Samples(edges, observed(scene, trajectory, function, times))


def observed(
    scene: Scene,
    trajectory: Trajectory,
    function: Callable[[Scene, State], PyTree],
    times: np.ndarray,
) -> PyTree:
    """`function(scene, state)` at times of any shape, as NumPy arrays of that shape."""
    padded = _padded(np.ravel(times))
    values = _observe(function, _as_arrays(scene), trajectory.dense, jnp.asarray(padded))
    return jax.tree_util.tree_map(
        lambda leaf: np.asarray(leaf)[: times.size].reshape(times.shape), values
    )


def at_steps(
    scene: Scene, trajectory: Trajectory, function: Callable[[Scene, State], PyTree]
) -> PyTree:
    """`function(scene, state)` at the ends of the solver's steps, as NumPy arrays."""
    return applied(scene, trajectory.state, function)


def applied(scene: Scene, state: State, function: Callable[[Scene, State], PyTree]) -> PyTree:
    """`function(scene, state)` at states with leaves of shape (n,), as NumPy arrays."""
    size = len(jax.tree_util.tree_leaves(state)[0])
    states = jax.tree_util.tree_map(lambda leaf: jnp.asarray(_padded(np.asarray(leaf))), state)
    values = _apply(function, _as_arrays(scene), states)
    return jax.tree_util.tree_map(lambda leaf: np.asarray(leaf)[:size], values)


def moments_of_change(
    scene: Scene,
    trajectory: Trajectory,
    condition: Callable[[Scene, State], Any],
    before: np.ndarray,
    after: np.ndarray,
) -> np.ndarray:
    """The times in (before, after) at which a condition changes, by bisection [s], shape (n,).

    `condition(scene, state)` is a boolean that differs between the two ends.
    """
    if before.size == 0:
        return before
    left, right = jnp.asarray(_padded(before)), jnp.asarray(_padded(after))
    found = _bisect(condition, _as_arrays(scene), trajectory.dense, left, right)
    return np.asarray(found)[: before.size]


def _padded(times: np.ndarray) -> np.ndarray:
    """Times filled up to a power of two, so that few lengths are compiled."""
    size = max(8, 1 << (len(times) - 1).bit_length())
    return np.pad(times, (0, size - len(times)), mode="edge")


def _as_arrays(scene: Scene) -> Scene:
    """The scene with every leaf an array: a plain number would be compiled in."""
    return jax.tree_util.tree_map(as_float, scene)


@eqx.filter_jit
def _apply(function: Any, scene: Scene, states: State) -> PyTree:
    return function(scene, states)


@eqx.filter_jit
def _observe(function: Any, scene: Scene, dense: Any, times: Any) -> PyTree:
    return function(scene, jax.vmap(dense.evaluate)(times))


@eqx.filter_jit
def _bisect(condition: Any, scene: Scene, dense: Any, left: Any, right: Any) -> Any:
    def holds(times: Any) -> Any:
        return condition(scene, jax.vmap(dense.evaluate)(times))

    at_left = holds(left)

    def halve(_: Any, ends: Any) -> Any:
        left, right = ends
        middle = 0.5 * (left + right)
        unchanged = holds(middle) == at_left
        return jnp.where(unchanged, middle, left), jnp.where(unchanged, right, middle)

    return jax.lax.fori_loop(0, _BISECTIONS, halve, (left, right))[1]
