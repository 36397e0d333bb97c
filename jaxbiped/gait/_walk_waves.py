"""Walks from many starts, in waves: where they settle, and where they all but return.

A walker whose dynamics is far from the seed's falls from nearly all starts about the seed's. The
few that go a footstep farther show where the next walks are to begin.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._progress import stage
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import recurring_leaves, state_of_recurring
from jaxbiped.gait._relaxation import is_far_from_seed
from jaxbiped.gait._search_starts import (
    rolling_starts,
    scattered_start_count,
    starts_scattered_by,
)
from jaxbiped.hybrid._scales import recurring_sizes
from jaxbiped.hybrid._sections import section_of
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import WalkerScene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.simulate._simulate import simulate

_DIGITS = 9
"""Decimals of scattered starts, in SI units."""
_CYCLES = 40
_ALIKE = 1e-2
"""Scaled distance of two states that count as one."""
_SHORTEST = 0.02
"""Advance in units of the height below which two arrivals are no step: a foot may also chatter."""
_DEPTH = 4
"""Longest cycle that is looked for in a walk's last arrivals."""
_FEW, _MANY = (16, 64), (1024,)
"""Starts from which walks are followed one after the other: in stiff motion, in other."""
_SPREADS = (0.3, 0.8)
"""Largest relative scatter of the starts' angles and rates, of one half and of the other."""
_COUNT, _BEST, _KEPT = 1024, 48, 16
"""Walks of a wave; the best of all so far, about which the next begins; those that must gain."""
_MOST, _PATIENCE, _GAIN = 24, 5, 1.02
"""Waves at most, and without a gain by this factor."""
_MOST_STEPS = 40_000_000
"""Solver steps after which no further wave begins: on stiff ground feet bounce for thousands."""
_FIRST, _LEAST, _WIDER, _NEAR = 0.5, 0.02, 1.3, 0.3
"""Standard deviation of the first starts, the least of others, how much wider than the best they
are spread, and of those about a single one."""
Pushed = Callable[[], list[np.ndarray]]
"""States without hip_x that take the place of some starts, at most half of them."""


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
        goes = np.diff(self.places[:, -2:])[:, 0] > _SHORTEST  # one that stands may chatter
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
        is_step = np.diff(self.places, axis=1) > _SHORTEST  # NaN is none
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


def walks_from(scene: WalkerScene, starts: WalkerState) -> Walks:
    """Walks from starts, leaves of shape (n,), for 40 cycles at most."""
    # Without last digits, in which versions of JAX differ: all come to the same gait, to the bit.
    rounded = jtu.tree_map(lambda leaf: np.round(np.asarray(leaf), _DIGITS), starts)
    return _walks_at(scene, *_arrivals(scene, rounded))


def _walks_at(
    scene: WalkerScene, counts: Scalar, arrivals: WalkerState, attempted: Scalar
) -> Walks:
    """Walks that arrived at these states, leaves of shape (n, 40), and how often."""
    sizes = recurring_sizes(scene, arrivals)
    points = np.stack(recurring_leaves(arrivals), axis=-1) / sizes
    places = np.where(np.isfinite(arrivals[0]), arrivals[0], np.nan) / float(scene.mechanism.height)
    return Walks(np.asarray(counts), points, sizes, places, int(np.sum(attempted)))


@cached_jit
def _arrivals(scene: WalkerScene, starts: WalkerState) -> tuple[Scalar, WalkerState, Scalar]:
    """Of each walk cycles, states at the arrivals that end them, the stance leg standing; steps."""
    system, section, footsteps = system_of(scene), section_of(scene, None), scene.cycle_footsteps
    each, how = footsteps // scene.arrival_footsteps, dict[str, Any]()
    if scene.stiff:  # whose steps are dear
        how = dict(accuracy="draft", engine="lanes")

    def one(start: PyTree) -> tuple[Scalar, PyTree, Scalar]:
        walk = simulate(
            scene,
            start,
            footsteps=footsteps * _CYCLES + (not system.footsteps_end_on_section),
            save=section,
            max_arrivals=each * _CYCLES,
            **how,
        )
        assert walk.arrivals is not None
        at = jtu.tree_map(lambda leaf: leaf[each - 1 :: each], walk.arrivals.state)
        named = system.in_nearest_names(section, scene, at, at)
        return walk.arrivals.total // each, named, walk.attempted

    return jax.vmap(one)(starts)


def walks_of(scene: WalkerScene, pushed: Pushed, *, most: int = _MOST) -> Iterator[Walks]:
    """Walks from more and more starts, for as long as they are asked for; of waves `most`."""
    if is_far_from_seed(scene):

        def walk(begun: np.ndarray, others: list[np.ndarray]) -> Walks:
            starts = starts_scattered_by(scene, jnp.asarray(begun.T))
            with stage(f"walking {_COUNT} starts, about those that walked farthest"):
                return _walks_from_rows(scene, type(starts), state_rows(starts), others)

        yield from islice(_waves(scattered_start_count(scene), walk, pushed), most)
        return
    for count in _FEW if scene.stiff else _MANY:
        halves = [
            rolling_starts(scene, count // 2, spread=spread, seed=k)
            for k, spread in enumerate(_SPREADS)
        ]
        with stage(f"walking {count} starts"):
            rows = np.concatenate([state_rows(half) for half in halves])
            walks = _walks_from_rows(scene, type(halves[0]), rows, pushed())
        yield walks


def state_rows(starts: WalkerState) -> np.ndarray:
    """States without hip_x as rows, shape (n, m)."""
    return np.stack(recurring_leaves(starts), axis=1)


def _walks_from_rows(
    scene: WalkerScene, kind: type, rows: np.ndarray, pushed: list[np.ndarray]
) -> Walks:
    """Walks from states without hip_x, some of them but the first replaced by others."""
    others = pushed[: len(rows) // 2]
    if others:
        rows[1 : 1 + len(others)] = others
    states = state_of_recurring(kind, map(jnp.asarray, rows.T), jnp.zeros(len(rows)))
    return walks_from(scene, states)


def _waves(
    size: int, walk: Callable[[np.ndarray, list[np.ndarray]], Walks], pushed: Pushed
) -> Iterator[Walks]:
    """Walks in waves, until some settle, or none gets much farther than those before.

    `walk` takes the scatter of starts, shape (n, size), and states that replace some of them.
    """
    numbers = np.random.default_rng(0)
    best, farthest, without, attempted = np.zeros((0, size)), np.zeros(0), 0, 0
    for _ in range(_MOST):
        begun, others = _draw(numbers, best, size), pushed()[: _COUNT // 2]
        walks = walk(begun, others)
        yield walks
        before, progress = farthest[:_KEPT].sum(), walks.progress()
        progress[1 : 1 + len(others)] = -np.inf  # they began elsewhere
        best, farthest = np.vstack([best, begun]), np.append(farthest, progress)
        order = np.argsort(-farthest, kind="stable")[:_BEST]
        best, farthest = best[order], farthest[order]
        without = 0 if farthest[:_KEPT].sum() > _GAIN * before else without + 1
        attempted += walks.attempted
        if walks.settled(1) or without == _PATIENCE or attempted > _MOST_STEPS:
            return


def _draw(numbers: np.random.Generator, best: np.ndarray, size: int) -> np.ndarray:
    """Scatter of a wave's starts, shape (n, size); the first is the best so far."""
    noise = numbers.standard_normal((_COUNT, size))
    noise[0] = 0.0
    if not len(best):
        return _FIRST * noise
    spread = np.maximum(_WIDER * best.std(axis=0), _LEAST)
    about = best[numbers.integers(len(best), size=_COUNT)]
    about[0] = best[0]
    far = np.arange(_COUNT)[:, None] % 2 == 1
    middle, width = np.where(far, best.mean(axis=0), about), np.where(far, 1.0, _NEAR)
    return middle + width * spread * noise
