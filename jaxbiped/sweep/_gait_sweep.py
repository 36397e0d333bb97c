"""Sweeps of gaits over parameters, in waves: no point of a wave needs another.

On a large grid a coarse lattice comes first, breadth first from one point; then each finer lattice
at once, from interpolation between the points that are known. Newton's method begins where the
neighbours point to; where that leads to no stable gait, at neighbours. Only then is a point
searched without a guess, which takes longest: in a region without gaits not each of them.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped._identity import provenance
from jaxbiped._progress import Stage, stage
from jaxbiped._types import as_float, rows_of
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import recurring_leaves, state_of_recurring
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_starts import default_guess, state_of_guess
from jaxbiped.hybrid._hybrid_system import SCENES
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.scene._parameter_access import (
    parameter_quantities,
    parameter_values,
    scene_identity,
    select_parameters,
    with_parameters,
)
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.sweep._gait_grid import (
    LARGE,
    GaitGrid,
    Place,
    Wave,
    extrapolated,
    interpolated,
    neighbours,
    open_gait_grid,
)
from jaxbiped.sweep._store_files import store_path, what_is_kept
from jaxbiped.sweep.starts._coordinates import parameter_axes

if TYPE_CHECKING:
    import xarray


_FEW, _MANY = 16, 256
"""Searches in a batch: every size is a program that XLA compiles."""
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


def gait_sweep(
    scene: AbstractScene,
    over: Mapping[str, Sequence[float] | np.ndarray],
    *,
    parameters: tuple[str, ...] | None = None,
    guess: Gait | PyTree | None = None,
    section: AbstractSection | None = None,
    footsteps: int | None = None,
    accuracy: str = "balanced",
    radius_sensitivities: bool = True,
    engine: str = "auto",
    store: str | Path | None = None,
    progress: bool | None = None,
    any_version: bool = False,
) -> "xarray.Dataset":
    """Finds the periodic gait at every point of a grid over scene parameters.

    The search begins without a guess at the point nearest to the scene's own parameters, and
    proceeds outwards. Each point starts from an extrapolation of its neighbours' gaits, so one
    branch is followed. If that gives no stable gait, Newton's method starts from the neighbours,
    and then the point is searched without a guess; a gait that this finds is followed to the
    neighbours.

    With the lanes engine, a grid of 64 points or more is searched in waves, all points of a wave at
    once: first a coarse lattice from its middle outwards, then finer ones from interpolated states.
    If a search without a guess finds nothing better there, it also speaks for the points up to two
    strides of the coarse lattice away, except those between two points with a better gait and,
    on the coarse lattice, those next to one.

    Args:
        scene: the walker or hybrid system; parameters that are not swept keep their values.
        over: values of each swept parameter by name (see `parameter_names`), arrays of shape (k,).
        parameters, footsteps, accuracy, radius_sensitivities, engine: as for `find_gait`.
        guess: a gait or a state near one, from which the first search begins, and every search that
            has no neighbours to begin from; a hybrid system needs one.
        section: section on which cycles begin. Default: as of `find_gait`.
        store: directory or address of a Zarr store (see `sweep`), from which an interrupted run
            continues. Default: in memory.
        progress: whether to show on stderr what is being done, how far it is and what was found; by
            default (None) after two seconds, in a terminal, a notebook or a command.
        any_version: whether to continue a store that another version of jaxbiped wrote.

    Returns:
        A dataset along the swept parameters, in SI units: the measures, `state_…`, multipliers,
        `sensitivity_…` with errors along `parameter`, `ending`, `found_by` and `branch_end` (codes,
        with names in the attributes), and `grazes` (see `Gait`). NaN where no gait was found; a
        `RuntimeWarning` says at how many points, and how they were searched (`found_by` is that of
        the last search). Another is issued if gaits graze a switch.

    Raises:
        ArgumentError: an argument is not allowed (raised before anything is compiled); or the store
            has other settings or cannot be written.
        ResourceError: the disk is full. The contents of the store are kept.
    """
    scene = check_scene(scene, *SCENES)
    section, near = section_of(scene, section), state_of_guess(scene.minimal, guess)
    if not isinstance(over, Mapping) or not over:
        raise ArgumentError(
            f"over = {over!r} is not allowed: map one parameter's name or more to its values, "
            'such as {"K": [1e6, 2e6]}.'
        )
    values = parameter_axes(scene, over, "over")
    select_parameters(scene.minimal, parameters)  # which refuses what is no name
    path = store_path(store)
    options: dict[str, Any] = dict(
        parameters=parameters,
        footsteps=footsteps,
        accuracy=accuracy,
        radius_sensitivities=radius_sensitivities,
    )
    own = scene_identity(scene)
    settings = {
        "scene": own["scene"],
        "models": own["model"],
        "over": {name: column.tolist() for name, column in values.items()},
        "options": {**options, "parameters": None if parameters is None else list(parameters)},
    }
    centre = _nearest(scene, values)

    def scene_at(place: Place) -> AbstractScene:
        point = {name: values[name][i] for name, i in zip(values, place, strict=True)}
        return with_parameters(scene, point)

    size = math.prod(map(len, values.values()))
    with stage(
        "finding gaits", total=size, unit="gaits", show=progress, kept=what_is_kept(path)
    ) as now:
        first = find_gait(scene_at(centre), near, section=section, engine=engine, **options)
        kind = type(first.measures.state)
        at_once = size >= LARGE and first.engine == "lanes"

        def search_alone(place: Place) -> Gait:
            if place == centre:
                return first
            return find_gait(scene_at(place), near, section=section, engine=engine, **options)

        def start_at(place: Place) -> np.ndarray:
            start = default_guess(scene_at(place)) if near is None else near
            return np.array(recurring_leaves(start), float)

        def find(places: Sequence[Place], guesses: np.ndarray) -> Iterator[tuple[slice, Gait]]:
            if at_once:
                columns = zip(values, np.transpose(places), strict=True)
                chosen = {name: values[name][rows] for name, rows in columns}
                yield from find_each(scene, chosen, guesses, kind, options | {"section": section})
                return
            for k, (place, guess) in enumerate(zip(places, guesses, strict=True)):
                start = jtu.tree_map(as_float, state_of_recurring(kind, guess))
                gait = find_gait(scene_at(place), start, section=section, engine=engine, **options)
                yield slice(k, k + 1), rows_of(gait, None)

        quantities = parameter_quantities(scene)
        grid = open_gait_grid(
            first, values, quantities, settings, provenance(scene), path, any_version=any_version
        )
        try:
            GaitWaves(grid, (centre, first), find, start_at, search_alone, now).run()
            grid.warn_of_missing()
            if at_once:
                grid.warn_of_grazing()
            return grid.dataset()
        except KeyboardInterrupt:
            grid.flush()  # what was found is not lost
            raise


def find_each(
    scene: AbstractScene,
    values: Mapping[str, np.ndarray],
    starts: np.ndarray,
    state: type,
    options: Mapping[str, Any],
) -> Iterator[tuple[slice, Gait]]:
    """The gaits that lanes come to, batch by batch: which of the n, and these with a first axis.

    `values` are of the parameters that differ, shape (n,) each; `starts` are states without
    `ROOT_x`, shape (n, m), of the type `state`; `options` are those of `find_gait`. Gaits have no
    orbits.
    """
    count, first = len(starts), 0
    scene = jtu.tree_map(as_float, scene)
    while first < count:
        size = _MANY if count - first > 3 * _FEW else _FEW
        part = slice(first, min(first + size, count))
        kept = part.stop - first
        missing = size - kept
        # A search from nowhere ends at once: it fills the batch.
        rows = np.pad(starts[part], ((0, missing), (0, 0)), constant_values=np.nan)
        columns = {k: np.pad(v[part], (0, missing), mode="edge") for k, v in values.items()}
        begin = state_of_recurring(state, np.ascontiguousarray(rows.T), np.zeros(size))
        gaits = _find_each(scene, columns, begin, dict(options))
        yield part, rows_of(gaits, slice(kept))
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


def _nearest(scene: AbstractScene, values: dict[str, np.ndarray]) -> Place:
    """The point of the grid nearest to the scene's own parameters."""
    own = parameter_values(scene)
    return tuple(int(np.argmin(np.abs(v - float(own[name])))) for name, v in values.items())


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
