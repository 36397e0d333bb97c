"""Sweep of gaits in waves: no point of a wave needs another.

On a large grid a coarse lattice comes first, breadth first from one point; then each finer lattice
at once, from interpolation between the points that are known. Newton's method begins where the
neighbours point to; where that leads to no stable gait, at neighbours. Only then is a point
searched without a guess, which takes longest: in a region without gaits not each of them.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

import numpy as np

from jaxbiped._progress import Stage
from jaxbiped._types import rows_of
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.sweep._gait_grid import (
    LARGE,
    GaitGrid,
    Place,
    Wave,
    extrapolated,
    interpolated,
    neighbours,
)

_COARSEST = 12
"""Points of the coarse lattice along the longest axis, about."""
_TRIES = 2
"""Neighbours from which a point with an unstable gait is searched again."""
_REACH = 2
"""How far a search without a guess that found nothing speaks for others, in the coarse lattice's
strides: those are not searched so."""

Find: TypeAlias = Callable[[Sequence[Place], np.ndarray], Iterator[tuple[slice, Gait]]]
"""Which of the points, and the gaits, with a first axis, to which Newton's method leads from the
states without `ROOT_x` that are given, shape (n, m)."""


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


def _lattice(shape: Sequence[int], first: Place, stride: int) -> Iterator[Place]:
    axes = [range(i % stride, size, stride) for i, size in zip(first, shape, strict=True)]
    return itertools.product(*axes)


class GaitWaves:
    """A sweep under way. Points that led to no stable gait are doubtful: they are written last."""

    def __init__(
        self,
        grid: GaitGrid,
        first: tuple[Place, Gait],
        find: Find,
        start_at: Callable[[Place], np.ndarray],
        search_alone: Callable[[Place], Gait],
        now: Stage,
    ) -> None:
        """`first` is the gait at one point; `now` counts the points that are done.

        `start_at` gives the start, without `ROOT_x`, of a search that has no neighbours' gaits.
        """
        self._grid, self._now, self._search_alone, self._find_from = grid, now, search_alone, find
        self._start_at = start_at
        self._first, gait = first
        # What is known so far: states, NaN where no gait is, and whether the gaits are stable.
        self._states = np.full_like(grid.states(), np.nan)
        self._shape = self._states.shape[:-1]
        self._stable = np.zeros(self._shape, dtype=bool)
        self._doubtful: dict[Place, Gait | None] = {}
        self._tried: dict[Place, list[Place]] = {}
        self._in_vain: list[Place] = []
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
        untried = [place for place, gait in self._doubtful.items() if gait is None]
        self._find(untried, np.array([self._start_at(place) for place in untried]))
        self._spread()
        self._search_without_guesses(plan)
        for place, best in self._doubtful.items():
            assert best is not None  # it was searched from a start, at least
            self._grid.write([place], rows_of(best, None))
            self._count(1)

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
        """One that has a stable gait; where this point has none at all, then any that has one."""
        tried, lacks = self._tried.get(place, []), np.isnan(self._states[place][0])
        if len(tried) >= _TRIES and not lacks:
            return None
        near = [n for n in neighbours(place, self._shape) if n not in tried]
        best = [n for n in near if self._stable[n]]
        if lacks:
            best += [n for n in near if np.isfinite(self._states[n][0])]
        return best[0] if best else None

    def _search_without_guesses(self, plan: Sequence[Wave]) -> None:
        """Searches points where that may come to more, and then those next to what was found."""
        reach = _REACH * plan[0].stride if np.prod(self._shape) >= LARGE else 0
        places = {place: wave.stride for wave in plan for place in wave.places}
        found = True
        while found:
            found = False
            for place, stride in list(places.items()):
                if place in self._doubtful and self._is_worth_a_search(place, stride, reach):
                    del places[place]
                    self._search_without_guess(place)
                    found = True

    def _search_without_guess(self, place: Place) -> None:
        gait = self._search_alone(place)
        if bool(gait.stable):
            self._keep([place], rows_of(gait, None))
        else:
            self._in_vain.append(place)
            self._doubt(place, gait)
            self._grid.write([place], rows_of(self._doubtful[place] or gait, None))
        self._spread()

    def _is_worth_a_search(self, place: Place, stride: int, reach: int) -> bool:
        """Whether no search without a guess nearby says what one here would come to.

        Such a search is worth it wherever a point has less than those on two opposite sides of it,
        or on the coarse lattice, where Newton's method has far to go, than one next to it.
        """
        own = self._rank(place)
        near = map(self._rank, neighbours(place, self._shape, stride))
        if stride * _REACH == reach and max(near) > own:
            return True
        for axis, size in enumerate(self._shape):
            sides = [(*place[:axis], place[axis] + k, *place[axis + 1 :]) for k in (-1, 1)]
            if 0 < place[axis] < size - 1 and min(map(self._rank, sides)) > own:
                return True
        return not any(
            self._rank(other) <= own and max(abs(np.subtract(place, other))) <= reach
            for other in self._in_vain
        )

    def _rank(self, place: Place) -> int:
        """0 without a gait, 1 with an unstable one, 2 with a stable one."""
        return int(np.isfinite(self._states[place][0])) + int(self._stable[place])


def _is_found(gait: Gait | None) -> bool:
    return gait is not None and int(gait.ending) == int(Search.FOUND)
