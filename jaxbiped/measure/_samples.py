"""Samples of a walk: between its steps, with integrals and moments of change; at heel strikes."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import AT_ONCE, Scalar, as_array, as_float, in_parts, rows_of
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._stance import of_stance
from jaxbiped.dynamics._state import check_state
from jaxbiped.dynamics._surfaces import standing_place
from jaxbiped.scene._scene import AbstractWalkerScene, RigidScene, Scene
from jaxbiped.scene._state_types import RigidState, SomeState, State
from jaxbiped.simulate._simulate import rigid_walk
from jaxbiped.simulate._trajectory import Arrivals, Trajectory, check_scene_of

SomeScene = TypeVar("SomeScene", bound=AbstractWalkerScene)
_Taken = TypeVar("_Taken")
NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_TO_ENDS = np.linalg.solve(np.vander(NODES).T, np.vander([-1.0, 1.0], len(NODES)).T)
"""Weights of values at the Gauss points by which their polynomial has those at both ends."""
_CUBIC = np.array([0.0, *[1.0 / (3.0 * NODES[3] ** 2)] * 3, 0.0])
_CUBIC[2] = 2.0 - 2.0 * _CUBIC[1]
"""Weights of a rule of order four at the three points within."""
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

    def roughness(self, leaf: np.ndarray) -> np.ndarray:
        """Tells how much an integral differs from that by a rule of lower order, shape (n,)."""
        return np.abs(np.diff(self.edges) * (leaf @ (0.5 * (_WEIGHTS - _CUBIC))))

    def positive_integral(self, leaf: np.ndarray) -> np.ndarray:
        """Integral of what of a leaf is above zero over each interval, shape (n,).

        Where its sign changes within an interval, between the roots of the polynomial through it.
        """
        drives = np.hstack([leaf, leaf @ _TO_ENDS]) > 0.0
        always = drives.all(axis=1)
        driving, halves = np.where(always, self.integral(leaf), 0.0), 0.5 * np.diff(self.edges)
        for row in np.flatnonzero(drives.any(axis=1) & ~always):
            curve = np.polynomial.Polynomial.fit(NODES, leaf[row], len(NODES) - 1, [-1.0, 1.0])
            roots = curve.roots()
            turns = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
            ends = np.concatenate([[-1.0], turns[np.abs(turns) < 1.0], [1.0]])
            parts = np.diff(curve.integ()(ends))
            driving[row] = halves[row] * parts[parts > 0.0].sum()
        return driving

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


def evaluate_along(
    scene: SomeScene, state: SomeState, function: Callable[[SomeScene, SomeState], PyTree]
) -> PyTree:
    """`function(scene, state)` at states with leaves of shape (n,), as NumPy arrays."""
    # With every leaf an array: a plain number would be compiled in.
    arrays = jtu.tree_map(as_float, scene)
    return in_parts(lambda states: _apply(function, arrays, states), state)


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


@host_jit()
def _apply(function: Callable[..., PyTree], scene: PyTree, states: PyTree) -> PyTree:
    values = function(scene, states)
    shape = jnp.shape(jtu.tree_leaves(states)[0])
    return jtu.tree_map(lambda leaf: jnp.broadcast_to(leaf, shape), values)


def states_after(scene: RigidScene, starts: RigidState, durations: np.ndarray) -> RigidState:
    """States so long after their starts [s], within their footsteps; leaves of shape (n,)."""
    return _walked(jtu.tree_map(as_float, scene), starts, durations)


@host_jit(within=True)
def _walked(scene: RigidScene, starts: RigidState, durations: np.ndarray) -> RigidState:
    return _walked_again(scene, starts, durations, lambda walk: walk.final)


class ModeChanges(NamedTuple):
    """Changes of mode within footsteps.

    Attributes:
        number: of each one's footstep, shape (m,).
        since: when they come in it [s], shape (m,).
        known: whether there was room for all of a footstep, shape (n,).
    """

    number: np.ndarray
    since: np.ndarray
    known: np.ndarray


def mode_changes(scene: RigidScene, starts: RigidState, durations: np.ndarray) -> ModeChanges:
    """The changes of mode so far after starts [s], shape (n,), which are walked again tightly."""
    history = _walked_again(scene, starts, durations, lambda walk: walk.mode_history)
    if history is None:
        return ModeChanges(np.zeros(0, int), np.zeros(0), np.ones(len(durations), bool))
    began = np.asarray(history.t)
    within = (began > 0.0) & (began < durations[:, None])
    known = np.asarray(history.total) < began.shape[1]
    return ModeChanges(np.nonzero(within)[0], began[within], known)


def _walked_again(
    scene: RigidScene,
    starts: RigidState,
    durations: np.ndarray,
    taken: Callable[[Trajectory[Any]], _Taken],
) -> _Taken:
    def walked(start: RigidState, duration: Scalar) -> _Taken:
        return taken(rigid_walk(scene, start, duration=cast("float", duration), accuracy="tight"))

    each: Callable[[RigidState, Scalar], _Taken] = jax.vmap(walked)
    return each(starts, jnp.asarray(durations))


def kept_strikes(scene: RigidScene, walk: Trajectory[Any]) -> tuple[np.ndarray, Any]:
    """Times [s] and states of the heel strikes that a walk kept, leaves of shape (n + 1,)."""
    check_type("scene", scene, RigidScene)
    check_type("walk", walk, Trajectory)
    check_type("walk.state", walk.state, scene.state_type)
    check_scene_of(walk, scene, "walk")
    assert walk.arrivals is not None
    times = np.asarray(walk.arrivals.t)
    known = np.isfinite(times)
    if times.ndim != 1 or known.sum() < 2:
        raise ArgumentError(
            "walk.arrivals has fewer than two heel strikes, which is not allowed: walk two "
            "footsteps or more with max_arrivals of as many."
        )
    return times[known], rows_of(walk.arrivals.state, known)


def from_start(scene: RigidScene, walk: Trajectory[Any], start: Any) -> Trajectory[Any]:
    """A rigid walk whose start is kept as a heel strike is, at time 0."""
    first, kept = check_state(start, scene.state_type, "start"), walk.arrivals
    total, t = 1, np.zeros(1)
    state = jtu.tree_map(lambda leaf: np.reshape(np.asarray(leaf), (1,)), first)
    if kept is not None:
        total, t = 1 + int(kept.total), np.append(t, np.asarray(kept.t))
        state = jtu.tree_map(lambda a, b: np.append(a, np.asarray(b)), state, kept.state)
    arrivals = Arrivals(as_array(np.asarray(total)), as_array(t), state)
    return dataclasses.replace(walk, arrivals=arrivals)


def places_of_standing(scene: RigidScene, states: Any) -> np.ndarray:
    """Where the standing foot of each state is along the slope [m]: below its centre, (n,)."""
    return np.asarray(evaluate_along(scene, states, _place_of_standing))


def _place_of_standing(scene: RigidScene, state: Any) -> Scalar:
    ahead = of_stance(scene, state, lambda stance: standing_place(stance) - stance.root.x)
    return state[0] + ahead
