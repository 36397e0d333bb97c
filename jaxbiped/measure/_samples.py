"""Samples of a trajectory between its steps: values, integrals and moments of change."""

from collections.abc import Callable
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import RigidState, State
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.simulate._simulate import rigid_walk
from jaxbiped.solve._trajectory import AT_ONCE, Trajectory, join_parts, split_evenly

NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_RESOLUTION = 2.0**48
"""By how much an interval is narrowed down that holds a change."""


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

    def positive_integral(self, leaf: np.ndarray) -> np.ndarray:
        """Integral of what of a leaf is above zero over each interval, shape (n,).

        Where its sign changes within an interval, between the roots of the polynomial through it.
        """
        whole, found = self.integral(leaf), np.zeros(len(leaf))
        found[(leaf > 0.0).all(axis=1)] = whole[(leaf > 0.0).all(axis=1)]
        halves = 0.5 * np.diff(self.edges)
        for row in np.flatnonzero((leaf > 0.0).any(axis=1) & (leaf <= 0.0).any(axis=1)):
            curve = np.polynomial.Polynomial.fit(NODES, leaf[row], len(NODES) - 1, [-1.0, 1.0])
            roots = curve.roots()
            turns = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
            ends = np.concatenate([[-1.0], turns[np.abs(turns) < 1.0], [1.0]])
            parts = np.diff(curve.integ()(ends))
            found[row] = halves[row] * parts[parts > 0.0].sum()
        return found

    def stretches(self, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which stretch between consecutive ends [s] each interval lies in, and whether in any."""
        stretch = np.searchsorted(ends, 0.5 * (self.edges[1:] + self.edges[:-1])) - 1
        return stretch, (stretch >= 0) & (stretch < len(ends) - 1)

    def totals(self, integrals: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Of integrals over the intervals those over the stretches between n + 1 ends, (n,)."""
        stretch, inside = self.stretches(ends)
        return np.bincount(stretch[inside], integrals[inside], minlength=len(ends) - 1)


def sample(
    scene: Scene,
    trajectory: Trajectory,
    function: Callable[[Scene, State], PyTree],
    extra: np.ndarray,
) -> Samples:
    """Samples `function(scene, state)` between the solver's steps and the `extra` times [s]."""
    edges = np.unique(np.concatenate([np.asarray(trajectory.t), extra]))
    middles, halves = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    times = middles[:, None] + halves[:, None] * NODES
    return Samples(edges, evaluate_at(scene, trajectory, function, times))


def evaluate_at(
    scene: Scene,
    trajectory: Trajectory,
    function: Callable[[Scene, State], PyTree],
    times: np.ndarray,
) -> PyTree:
    """`function(scene, state)` at times of any shape, as NumPy arrays of that shape."""
    values = evaluate_along(scene, trajectory.at(np.ravel(times)), function)
    return jtu.tree_map(lambda leaf: leaf.reshape(times.shape), values)


def at_steps(
    scene: Scene, trajectory: Trajectory, function: Callable[[Scene, State], PyTree]
) -> PyTree:
    """`function(scene, state)` at the ends of the solver's steps, as NumPy arrays."""
    return evaluate_along(scene, trajectory.state, function)


def evaluate_along(
    scene: Scene, state: State, function: Callable[[Scene, State], PyTree]
) -> PyTree:
    """`function(scene, state)` at states with leaves of shape (n,), as NumPy arrays."""
    # With every leaf an array: a plain number would be compiled in.
    arrays = jtu.tree_map(as_float, scene)
    leaves, structure = jtu.tree_flatten(state)
    states = zip(*[split_evenly(np.asarray(leaf)) for leaf in leaves], strict=True)
    found = [_apply(function, arrays, jtu.tree_unflatten(structure, part)) for part in states]
    return join_parts(found, len(leaves[0]))


def moments_of_change(
    scene: Scene,
    trajectory: Trajectory,
    function: Callable[[Scene, State], PyTree],
    condition: Callable[[PyTree], np.ndarray],
    before: np.ndarray,
    after: np.ndarray,
) -> np.ndarray:
    """The times in (before, after) at which a condition changes [s], shape (n,).

    `condition` makes booleans (n, m) of the function's values at m times in each of the n
    intervals, leaves (n, m); they differ between the two ends.
    """
    if before.size == 0:
        return before
    among = max(3, AT_ONCE // len(before))
    shares = np.linspace(0.0, 1.0, among)
    left, right, rows = before, after, np.arange(len(before))
    for _ in range(int(np.ceil(np.log(_RESOLUTION) / np.log(among - 1)))):
        times = left[:, None] + (right - left)[:, None] * shares
        times[:, -1] = right
        holds = condition(evaluate_at(scene, trajectory, function, times))
        changed = holds != holds[:, :1]
        changed[:, -1] = True
        first = np.argmax(changed, axis=1)
        left, right = times[rows, first - 1], times[rows, first]
    return right


@cached_jit
def _apply(function: Callable[..., PyTree], scene: Scene, states: State) -> PyTree:
    values = function(scene, states)
    shape = jnp.shape(jtu.tree_leaves(states)[0])
    return jtu.tree_map(lambda leaf: jnp.broadcast_to(leaf, shape), values)


def states_after(scene: RigidScene, starts: RigidState, durations: np.ndarray) -> RigidState:
    """States so long after their starts [s], within their footsteps; leaves of shape (n,)."""

    def walked(start: RigidState, duration: Scalar) -> RigidState:
        return rigid_walk(scene, start, duration=cast("float", duration), accuracy="tight").final

    each: Callable[[RigidState, Scalar], RigidState] = jax.vmap(walked)
    return each(starts, jnp.asarray(durations))
