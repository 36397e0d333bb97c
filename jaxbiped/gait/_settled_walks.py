"""Walks from many starts: where they settle, and where they all but return."""

from typing import Any, NamedTuple

import jax
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.dynamics._surfaces import in_nearest_names
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.simulate._simulate import rigid_walk, simulate
from jaxbiped.solve._accuracy import recurring_sizes
from jaxbiped.variational._hybrid_system import section_of

_DIGITS = 9
"""Decimals of scattered starts, in SI units."""
_CYCLES = 40
_ALIKE = 1e-2
"""Scaled distance of two states that count as one."""
SHORTEST = 0.02
"""Advance in units of the height below which two arrivals are no step: a foot may also chatter."""
_DEPTH = 4
"""Longest cycle that is looked for in a walk's last arrivals."""


class Walks(NamedTuple):
    """Arrivals at the section of n walks.

    Attributes:
        counts: how many each has, shape (n,).
        points: states there without hip_x, scaled, shape (n, 40, m); NaN beyond the last.
        sizes: of their components, shape (m,).
        places: along the slope, in units of the walker's height, shape (n, 40); NaN likewise.
        attempted: steps that all of them took together.
    """

    counts: np.ndarray
    points: np.ndarray
    sizes: np.ndarray
    places: np.ndarray
    attempted: int = 0

    def settled(self, most: int = 4) -> list[np.ndarray]:
        """Where those that walked on are in the end, the most settled first, shapes (m,)."""
        goes = np.diff(self.places[:, -2:])[:, 0] > SHORTEST  # one that stands may chatter
        walking = np.flatnonzero((self.counts >= _CYCLES) & goes)
        latest, before = self.points[walking, -1], self.points[walking, -1 - _DEPTH : -1]
        moved = np.linalg.norm(latest[:, None] - before, axis=-1)
        return self._apart(latest, np.min(moved, axis=-1, initial=np.inf), most)

    def progress(self) -> np.ndarray:
        """How far each walks: its steps ahead, and by how little one changes the state."""
        moved = self._moved()
        nearest = np.min(moved, axis=1)
        # Without last digits, so that versions of JAX put them in one order.
        return np.round(np.isfinite(moved).sum(axis=1) + 1.0 / (1.0 + nearest), 6)

    def near_returns(self, most: int) -> list[np.ndarray]:
        """Arrivals whose next one is nearest to them, the nearest first, shapes (m,)."""
        moved = self._moved()
        best = np.argmin(moved, axis=1)
        every = np.arange(len(best))
        returned = np.isfinite(moved[every, best])
        nearest = self.points[every, best][returned]
        return self._apart(nearest, moved[every, best][returned], most)

    def _moved(self) -> np.ndarray:
        """Distance of each arrival's state from the next; infinite without a step between."""
        is_step = np.diff(self.places, axis=1) > SHORTEST  # NaN is none
        before, after = (np.where(is_step[..., None], x, 0.0)
                         for x in (self.points[:, :-1], self.points[:, 1:]))  # fmt: skip
        return np.where(is_step, np.linalg.norm(after - before, axis=-1), np.inf)

    def _apart(self, points: np.ndarray, moved: np.ndarray, most: int) -> list[np.ndarray]:
        chosen: list[int] = []
        for i in np.argsort(moved):
            if all(np.linalg.norm(points[i] - points[j]) > _ALIKE for j in chosen):
                chosen.append(int(i))
            if len(chosen) == most:
                break
        return [points[i] * self.sizes for i in chosen]


def walks_from(scene: Scene | RigidScene, starts: WalkerState) -> Walks:
    """Walks from starts, leaves of shape (n,), for 40 cycles at most."""
    walked: Any = _arrivals if scene.compliant else _rigid_arrivals
    # Without last digits, in which versions of JAX differ: all come to the same gait, to the bit.
    rounded = jtu.tree_map(lambda leaf: np.round(np.asarray(leaf), _DIGITS), starts)
    counts, arrivals, attempted = walked(scene, rounded)
    sizes = recurring_sizes(scene, arrivals)
    points = np.stack(recurring_leaves(arrivals), axis=-1) / sizes
    places = np.where(np.isfinite(arrivals[0]), arrivals[0], np.nan) / float(scene.mechanism.height)
    return Walks(np.asarray(counts), points, sizes, places, int(np.sum(attempted)))


@cached_jit
def _arrivals(scene: Scene, starts: WalkerState) -> tuple[Scalar, WalkerState, Scalar]:
    """Of each walk arrivals at the section, states at them, the stance leg standing, and steps."""
    section, footsteps = section_of(scene, None), scene.mechanism.structure.cycle_footsteps

    def one(start: PyTree) -> tuple[Scalar, PyTree, Scalar]:
        walk = simulate(
            scene,
            start,
            footsteps=footsteps * _CYCLES + 1,
            accuracy="draft",
            save=section,
            max_arrivals=_CYCLES,
            engine="lanes",
        )
        assert walk.arrivals is not None
        at = walk.arrivals.state
        return walk.arrivals.total, in_nearest_names(section, scene, at, at), walk.attempted

    return jax.vmap(one)(starts)


@cached_jit
def _rigid_arrivals(scene: RigidScene, starts: WalkerState) -> tuple[Scalar, WalkerState, Scalar]:
    """Of each walk cycles, states just after the heel strike that ends each, and steps."""
    each = scene.mechanism.structure.cycle_footsteps

    def one(start: PyTree) -> tuple[Scalar, PyTree, Scalar]:
        walk = rigid_walk(scene, start, footsteps=each * _CYCLES, max_arrivals=each * _CYCLES)
        assert walk.arrivals is not None
        last = jtu.tree_map(lambda leaf: leaf[each - 1 :: each], walk.arrivals.state)
        return walk.arrivals.total // each, last, walk.attempted

    return jax.vmap(one)(starts)
