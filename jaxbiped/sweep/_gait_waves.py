"""Sweep of gaits in waves: all points of a wave are searched at once, by lanes.

Newton's method from where the neighbours point to, first on a coarse lattice; where that leads to
no stable gait, from neighbours; and only then without a guess.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.sweep._gait_grid import GaitGrid
from jaxbiped.sweep._grid_waves import Place, Wave, extrapolated, interpolated, neighbours, waves

_FEW, _MANY = 16, 256
"""Searches in a batch: every size is a program that XLA compiles."""
_TRIES = 2
"""Neighbours from which a point is searched again."""


def find_each(
    scene: AbstractScene,
    values: Mapping[str, np.ndarray],
    starts: np.ndarray,
    state: type,
    options: Mapping[str, Any],
) -> Iterator[tuple[slice, Gait]]:
    """The gaits that Newton's method comes to, part by part.

    Args:
        scene: the walker.
        values: of the parameters that differ, shape (n,) each.
        starts: states without hip_x, shape (n, m).
        state: their type.
        options: those of `find_gait`.

    Yields:
        Which of the n, and their gaits, every array of NumPy with a first axis; no orbits.
    """
    count, first = len(starts), 0
    scene = jtu.tree_map(as_float, scene)
    while first < count:
        size = _MANY if count - first > 3 * _FEW else _FEW
        part = slice(first, min(first + size, count))
        missing = size - (part.stop - first)
        # A search from nowhere ends at once: it fills the batch.
        rows = np.pad(starts[part], ((0, missing), (0, 0)), constant_values=np.nan)
        columns = {k: np.pad(v[part], (0, missing), mode="edge") for k, v in values.items()}
        begin = state(np.zeros(size), *np.ascontiguousarray(rows.T))
        gaits = _find_each(scene, columns, begin, dict(options))
        kept = part.stop - first
        yield part, jtu.tree_map(lambda leaf, kept=kept: np.asarray(leaf)[:kept], gaits)
        first = part.stop


@cached_jit
def _find_each(
    scene: AbstractScene, values: dict[str, np.ndarray], starts: PyTree, options: dict[str, Any]
) -> Gait:
    def one(values: dict[str, np.ndarray], start: PyTree) -> Gait:
        own = jtu.tree_map(jnp.asarray, with_parameters(scene, values))
        # Times and states of all steps would take more memory than all else.
        gait = find_gait(own, start, **options)
        return dataclasses.replace(gait, orbit=None)  # type: ignore[arg-type]

    return jax.vmap(one)(values, starts)


class GaitWaves:
    """A sweep under way.

    Points that led to no stable gait are doubtful: they are written when all else is.
    """

    def __init__(
        self,
        scene: AbstractScene,
        values: Mapping[str, np.ndarray],
        first: tuple[Place, Gait],
        grid: GaitGrid,
        options: Mapping[str, Any],
        search_alone: Callable[[Place], Gait],
        tell: Callable[[int], object],
    ) -> None:
        """`first` is the gait at one point, `tell` is told how many points are done."""
        self._scene, self._values, self._grid = scene, values, grid
        self._options, self._search_alone, self._tell = options, search_alone, tell
        self._shape = tuple(map(len, values.values()))
        self._first, gait = first
        self._type = type(gait.measures.state)
        # What is known so far: states, NaN where no gait is, and whether the gaits are stable.
        self._states = np.full((*self._shape, len(self._type._fields) - 1), np.nan)
        self._stable = np.zeros(self._shape, dtype=bool)
        self._doubtful: dict[Place, Gait | None] = {}
        self._tried: dict[Place, list[Place]] = {}

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
        new = [not self._grid.is_done(place, found=False) for place in wave.places]
        old = [place for place, is_new in zip(wave.places, new, strict=True) if not is_new]
        leads = np.array(new) & np.all(np.isfinite(guesses), axis=1)
        for place, is_new, leads_on in zip(wave.places, new, leads, strict=True):
            if is_new and not leads_on:
                self._doubtful[place] = None
        known = self._grid.states()
        for place in old:
            self._states[place] = known[place]
            self._stable[place] = self._grid.is_stable(place)
        self._tell(len(old))
        self._find([p for p, on in zip(wave.places, leads, strict=True) if on], guesses[leads])

    def _find(self, places: Sequence[Place], guesses: np.ndarray) -> None:
        """Newton's method at these points, from these states."""
        if not places:
            return
        at = np.transpose(places)
        values = {name: v[i] for (name, v), i in zip(self._values.items(), at, strict=True)}
        parts = find_each(self._scene, values, guesses, self._type, self._options)
        for part, gaits in parts:
            stable, here = np.asarray(gaits.stable), places[part]
            self._keep([here[k] for k in map(int, np.flatnonzero(stable))], _rows(gaits, stable))
            for k in map(int, np.flatnonzero(~stable)):
                self._doubt(here[k], _rows(gaits, k))

    def _keep(self, places: Sequence[Place], gaits: Gait) -> None:
        """Stable gaits are what was sought."""
        if not places:
            return
        at = tuple(np.transpose(places))
        self._states[at] = np.stack(recurring_leaves(gaits.measures.state), axis=-1)
        self._stable[at] = True
        for place in places:
            self._doubtful.pop(place, None)
        self._grid.write_each(places, gaits)
        self._tell(len(places))

    def _doubt(self, place: Place, gait: Gait) -> None:
        best = self._doubtful.get(place)
        found = int(gait.ending) == int(Search.FOUND)
        if best is None or (found and int(best.ending) != int(Search.FOUND)):
            self._doubtful[place] = gait
            if found:
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
        missing = best is None or int(best.ending) != int(Search.FOUND)
        if missing or alone:
            gait = self._search_alone(place)
            if bool(gait.stable):
                self._keep([place], _rows(gait, None))
                self._spread()
                return
            if missing:
                best = gait
        assert best is not None
        self._doubtful.pop(place)
        self._grid.write(place, best)
        if int(best.ending) == int(Search.FOUND):
            self._states[place] = np.stack(recurring_leaves(best.measures.state))
        self._tell(1)


def _rows(gaits: Gait, which: Any) -> Gait:
    """Some of several gaits."""
    rows: Gait = jtu.tree_map(lambda leaf: np.asarray(leaf)[which], gaits)
    return rows
