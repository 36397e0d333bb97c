"""Waves of walks: from starts about the seed's, then about those that walked farthest.

A walker whose dynamics is far from the seed's falls from nearly all starts about the seed's. The
few that go a footstep farther show where the next walks are to begin.
"""

from collections.abc import Callable, Iterator
from itertools import islice

import jax.numpy as jnp
import numpy as np

from jaxbiped._progress import stage
from jaxbiped.dynamics._state import recurring_leaves, state_of_recurring
from jaxbiped.gait._search_starts import (
    rolling_starts,
    scattered_start_count,
    starts_scattered_by,
)
from jaxbiped.gait._settled_walks import Walks, walks_from
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.scene._walker import Walker

_FEW, _MANY = (16, 64), (1024,)
"""Starts from which walks of the seed's bodies are followed: compliant, rigid."""
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


def is_far_from_seed(scene: Scene | RigidScene) -> bool:
    """Whether a walker on compliant feet has other bodies than the seed's."""
    return isinstance(scene, Scene) and not isinstance(scene.walker, Walker)


def walks_of(scene: Scene | RigidScene, pushed: Pushed, *, most: int = _MOST) -> Iterator[Walks]:
    """Walks from more and more starts, for as long as they are asked for; of waves `most`."""
    if is_far_from_seed(scene):
        yield from islice(_waves(scene, pushed), most)
        return
    for count in _FEW if isinstance(scene, Scene) else _MANY:
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
    scene: Scene | RigidScene, kind: type, rows: np.ndarray, pushed: list[np.ndarray]
) -> Walks:
    """Walks from states without hip_x, some of them but the first replaced by others."""
    others = pushed[: len(rows) // 2]
    if others:
        rows[1 : 1 + len(others)] = others
    states = state_of_recurring(kind, map(jnp.asarray, rows.T), jnp.zeros(len(rows)))
    return walks_from(scene, states)


def _waves(scene: Scene | RigidScene, pushed: Pushed) -> Iterator[Walks]:
    """Walks in waves, until some settle, or none gets much farther than those before."""
    numbers = np.random.default_rng(0)
    size = scattered_start_count(scene)
    best, farthest, without, attempted = np.zeros((0, size)), np.zeros(0), 0, 0
    for _ in range(_MOST):
        begun, others = _draw(numbers, best, size), pushed()[: _COUNT // 2]
        starts = starts_scattered_by(scene, jnp.asarray(begun.T))
        with stage(f"walking {_COUNT} starts, about those that walked farthest"):
            walks = _walks_from_rows(scene, type(starts), state_rows(starts), others)
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
