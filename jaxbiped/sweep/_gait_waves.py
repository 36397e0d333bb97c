"""Sweep of gaits in waves: no point of a wave needs another.

On a large grid a coarse lattice comes first, breadth first from one point; then each finer lattice
at once, from interpolation between the points that are known. Newton's method begins where the
neighbours point to; where that leads to no stable gait, at neighbours; and only then without a
guess.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import jax.tree_util as jtu
import numpy as np

from jaxbiped._progress import Stage
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.sweep._gait_grid import GaitGrid

Place: TypeAlias = tuple[int, ...]
"""Indices of a point."""

LARGE = 64
"""Points from which on a grid is large."""
_COARSEST = 12
"""Points of the coarse lattice along the longest axis, about."""
_STENCILS: tuple[dict[int, float], ...] = (
    {-3: -1 / 16, -1: 9 / 16, 1: 9 / 16, 3: -1 / 16},
    {-1: 0.5, 1: 0.5},
    {-1: 1.5, -3: -0.5},
    {1: 1.5, 3: -0.5},
    {-1: 1.0},
    {1: 1.0},
)
"""Weights of points so many steps away for the point between them, the best first."""


class Wave(NamedTuple):
    """Points none of which needs another.

    Attributes:
        places: the points.
        stride: steps along an axis between neighbours on the wave's lattice.
        fills: whether the points lie between those of the lattice that is twice as coarse; else
            beyond those of the waves before.
    """

    places: list[Place]
    stride: int
    fills: bool


def waves(shape: Sequence[int], first: Place) -> list[Wave]:
    """All points of a grid in the order in which they are searched; `first` is the first wave."""
    stride = 1
    if np.prod(shape) >= LARGE:
        while 2 * stride * _COARSEST <= max(shape):
            stride *= 2
    found = [Wave(each, stride, False) for each in rings(shape, first, stride)]
    while stride > 1:
        stride //= 2
        coarser = set(_lattice(shape, first, 2 * stride))
        places = [place for place in _lattice(shape, first, stride) if place not in coarser]
        found.append(Wave(places, stride, True))
    return found


def neighbours(place: Place, shape: Sequence[int], stride: int = 1) -> Iterator[Place]:
    """The points next to one, one axis after the other."""
    for axis, size in enumerate(shape):
        for step in (-stride, stride):
            moved = place[axis] + step
            if 0 <= moved < size:
                yield (*place[:axis], moved, *place[axis + 1 :])


def rings(shape: Sequence[int], first: Place, stride: int = 1) -> Iterator[list[Place]]:
    """The lattice's points by how many strides they are away."""
    seen, ring = {first}, [first]
    while ring:
        yield ring
        following = []
        for place in ring:
            for near in neighbours(place, shape, stride):
                if near not in seen:
                    seen.add(near)
                    following.append(near)
        ring = following


def extrapolated(states: np.ndarray, wave: Wave) -> np.ndarray:
    """Where the points of a wave beyond the known ones may lie: on from the nearest two, or one.

    `states` has shape (*grid, m), NaN where nothing is known; the result (n, m).
    """
    shape = states.shape[:-1]
    found = np.full((len(wave.places), states.shape[-1]), np.nan)
    for k, place in enumerate(wave.places):
        best = None
        for near in neighbours(place, shape, wave.stride):
            if np.isnan(states[near][0]):
                continue
            beyond = tuple(2 * a - b for a, b in zip(near, place, strict=True))
            inside = all(0 <= i < size for i, size in zip(beyond, shape, strict=True))
            if inside and not np.isnan(states[beyond][0]):
                best = 2.0 * states[near] - states[beyond]
                break
            best = states[near] if best is None else best
        if best is not None:
            found[k] = best
    return found


def interpolated(states: np.ndarray, first: Place, wave: Wave) -> np.ndarray:
    """Where the points of a wave between the known ones may lie, as `extrapolated`.

    By cubic polynomials along one axis after the other, by lower ones where points are missing.
    """
    coarse = np.full_like(states, np.nan)
    known = tuple(slice(i % (2 * wave.stride), None, 2 * wave.stride) for i in first)
    coarse[known] = states[known]
    for axis, begin in enumerate(first):
        rows = np.moveaxis(coarse, axis, 0)[begin % wave.stride :: wave.stride]
        odd = (begin // wave.stride + 1) % 2
        rows[odd::2] = _between(rows, odd)
    return coarse[tuple(np.transpose(wave.places))]


def _between(rows: np.ndarray, odd: int) -> np.ndarray:
    """Values in every second row, from `odd` on, by the rows between them."""
    margin = np.full((3, *rows.shape[1:]), np.nan)
    padded = np.concatenate([margin, rows, margin])
    count = len(rows[odd::2])
    best = np.full((count, *rows.shape[1:]), np.nan)
    for stencil in _STENCILS:
        value = sum(
            weight * padded[3 + odd + step : 3 + odd + step + 2 * count - 1 : 2]
            for step, weight in stencil.items()
        )
        best = np.where(np.isnan(best), value, best)
    return best


def _lattice(shape: Sequence[int], first: Place, stride: int) -> Iterator[Place]:
    axes = [range(i % stride, size, stride) for i, size in zip(first, shape, strict=True)]
    return itertools.product(*axes)


_TRIES = 2
"""Neighbours from which a point is searched again."""

Find: TypeAlias = Callable[[Sequence[Place], np.ndarray], Iterator[tuple[slice, Gait]]]
"""Which of the points, and the gaits, with a first axis, to which Newton's method leads from the
states without `ROOT_x` that are given, shape (n, m)."""


class GaitWaves:
    """A sweep under way. Points that led to no stable gait are doubtful: they are written last."""

    def __init__(
        self,
        grid: GaitGrid,
        first: tuple[Place, Gait],
        find: Find,
        search_alone: Callable[[Place], Gait],
        now: Stage,
    ) -> None:
        """`first` is the gait at one point; `now` counts the points that are done."""
        self._grid, self._now, self._search_alone, self._find_from = grid, now, search_alone, find
        self._first, gait = first
        # What is known so far: states, NaN where no gait is, and whether the gaits are stable.
        self._states = np.full_like(grid.states(), np.nan)
        self._shape = self._states.shape[:-1]
        self._stable = np.zeros(self._shape, dtype=bool)
        self._doubtful: dict[Place, Gait | None] = {}
        self._tried: dict[Place, list[Place]] = {}
        if not grid.is_done(self._first):
            if bool(gait.stable):
                grid.write([self._first], rows_of(gait, None))
            else:
                self._doubt(self._first, gait)

    def run(self) -> None:
        """Searches whatever the grid does not hold yet."""
        plan = waves(self._shape, self._first)
        for wave in plan:
            self._search(wave)
        self._spread()
        coarse = {place for wave in plan if not wave.fills for place in wave.places}
        for place in [place for wave in plan for place in wave.places]:
            if place in self._doubtful:
                self._settle(place, alone=place in coarse)

    def _search(self, wave: Wave) -> None:
        """One wave; what it finds is known after it."""
        if wave.fills:
            guesses = interpolated(self._states, self._first, wave)
        else:
            guesses = extrapolated(self._states, wave)
        known, leads = self._grid.states(), []
        for k, place in enumerate(wave.places):
            if self._grid.is_done(place):
                self._states[place] = known[place]
                self._stable[place] = self._grid.is_stable(place)
                self._count(1)
            elif np.all(np.isfinite(guesses[k])):
                leads.append(k)
            else:
                self._doubtful.setdefault(place, None)
        self._find([wave.places[k] for k in leads], guesses[leads])

    def _find(self, places: Sequence[Place], guesses: np.ndarray) -> None:
        """Newton's method at these points, from these states."""
        if not places:
            return
        for part, gaits in self._find_from(places, guesses):
            stable, here = np.asarray(gaits.stable), places[part]
            self._keep([here[k] for k in map(int, np.flatnonzero(stable))], rows_of(gaits, stable))
            for k in map(int, np.flatnonzero(~stable)):
                self._doubt(here[k], rows_of(gaits, k))

    def _keep(self, places: Sequence[Place], gaits: Gait) -> None:
        """Stable gaits are what was sought."""
        if not places:
            return
        at = tuple(np.transpose(places))
        self._states[at] = np.stack(recurring_leaves(gaits.measures.state), axis=-1)
        self._stable[at] = True
        for place in places:
            self._doubtful.pop(place, None)
        self._grid.write(places, gaits)
        self._count(len(places))

    def _count(self, points: int) -> None:
        self._now.update(points, f"{np.sum(self._stable):,} of them stable")

    def _doubt(self, place: Place, gait: Gait) -> None:
        if not _is_found(self._doubtful.get(place)):
            self._doubtful[place] = gait
            if _is_found(gait):
                self._states[place] = np.stack(recurring_leaves(gait.measures.state))

    def _spread(self) -> None:
        """Searches doubtful points from their neighbours, as long as there are new ones."""
        while True:
            pairs = {}
            for place in self._doubtful:
                near = self._untried_neighbour(place)
                if near is not None:
                    pairs[place] = near
                    self._tried.setdefault(place, []).append(near)
            if not pairs:
                return
            self._find(list(pairs), np.stack([self._states[near] for near in pairs.values()]))

    def _untried_neighbour(self, place: Place) -> Place | None:
        """One that has a stable gait, or any where this point has none."""
        tried = self._tried.get(place, [])
        if len(tried) >= _TRIES:
            return None
        near = [n for n in neighbours(place, self._shape) if n not in tried]
        stable = [n for n in near if self._stable[n]]
        if not stable and np.isnan(self._states[place][0]):
            stable = [n for n in near if np.isfinite(self._states[n][0])]
        return stable[0] if stable else None

    def _settle(self, place: Place, *, alone: bool) -> None:
        """Writes what is best at a doubtful point, searched without a guess where need be."""
        best = self._doubtful[place]
        if alone or not _is_found(best):
            gait = self._search_alone(place)
            if bool(gait.stable):
                self._keep([place], rows_of(gait, None))
                self._spread()
                return
            best = best if _is_found(best) else gait
        assert best is not None
        self._doubtful.pop(place)
        self._grid.write([place], rows_of(best, None))
        if _is_found(best):
            self._states[place] = np.stack(recurring_leaves(best.measures.state))
        self._count(1)


def _is_found(gait: Gait | None) -> bool:
    return gait is not None and int(gait.ending) == int(Search.FOUND)


def rows_of(gaits: Gait, which: Any) -> Gait:
    """Some of several gaits; of a single one, by None, a batch."""
    rows: Gait = jtu.tree_map(lambda leaf: np.asarray(leaf)[which], gaits)
    return rows
