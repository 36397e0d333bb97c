"""Grid of gaits over parameters: its dataset, in memory or in a Zarr store; and its geometry.

Its points are searched on lattices, from coarse to fine: what is known of gaits there tells where
those of other points may lie.
"""

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from jaxbiped._checks import ArgumentError, warn
from jaxbiped._files import strict_json
from jaxbiped._quantity import Quantity
from jaxbiped._tables import variables_of
from jaxbiped._types import JsonObject
from jaxbiped.dynamics._state import recurring_names
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait, gait_coordinates, gait_entries
from jaxbiped.gait._search_provenance import FoundBy
from jaxbiped.sweep._store_files import SETTINGS, continue_store, open_store, writing

if TYPE_CHECKING:
    import xarray

Place: TypeAlias = tuple[int, ...]
"""Indices of a point."""

LARGE = 64
"""Points from which on a grid is large."""
_DONE = "done"
_PAUSE = 2.0
"""Seconds between two writes of a store, at least."""
_SHARE = 20.0
"""How much longer than a write takes."""
_STENCILS: tuple[dict[int, float], ...] = (
    {-3: -1 / 16, -1: 9 / 16, 1: 9 / 16, 3: -1 / 16},
    {-1: 0.5, 1: 0.5},
    {-1: 1.5, -3: -0.5},
    {1: 1.5, 3: -0.5},
    {-1: 1.0},
    {1: 1.0},
)
"""Weights of points so many steps away for the point between them, the best first."""


class GaitGrid:
    """Results of a sweep of gaits, written point by point."""

    def __init__(self, dataset: "xarray.Dataset", state: type, path: Path | None) -> None:
        self._dataset, self._state, self._path = dataset, state, path
        self._written, self._pause = time.monotonic(), _PAUSE

    def is_done(self, place: Place) -> bool:
        """Whether it is known what a point has, a gait or none."""
        return bool(self._dataset[_DONE].data[place])

    def is_stable(self, place: Place) -> bool:
        return bool(self._dataset["spectral_radius"].data[place] < 1.0)

    def states(self) -> np.ndarray:
        """States without `ROOT_x` at all points, shape (*grid, m); NaN where there is no gait."""
        names = recurring_names(self._state)
        return np.stack([self._dataset[f"state_{name}"].data for name in names], axis=-1)

    def write(self, places: Sequence[Place], gaits: Gait) -> None:
        """Keeps gaits, whose arrays have a first axis; every few seconds in the store, too."""
        at = tuple(np.transpose(places))
        for name, (_, values, _) in variables_of(gait_entries(gaits)).items():
            self._dataset[name].data[at] = values
        self._dataset[_DONE].data[at] = True
        if self._path is not None and time.monotonic() - self._written > self._pause:
            self.flush()

    def dataset(self) -> "xarray.Dataset":
        """The results; of a store, opened lazily."""
        if self._path is None:
            return self._dataset.drop_vars(_DONE)
        self.flush()
        return open_store(self._path).drop_vars(_DONE)

    def warn_of_grazing(self) -> None:
        """Warns where gaits' derivatives are not determined, as `find_gait` does of one."""
        count = int(np.sum(self._dataset["grazes"].data > 0))
        if count:
            warn(
                f"{count} of the gaits graze a switch (`grazes`), as a foot that barely touches "
                "the ground or misses it: their multipliers are those of one side, their "
                "sensitivities are not known.",
            )

    def warn_of_missing(self) -> None:
        """Warns of points without a gait, and says how they were searched."""
        missing = self._dataset["ending"].data != int(Search.FOUND)
        if count := int(np.sum(missing)):
            alone = int(np.sum(missing & (self._dataset["found_by"].data != int(FoundBy.GUESS))))
            warn(
                f"no gait was found at {count} of the {missing.size} points (`ending`): {alone} of "
                f"them were searched without a guess, the other {count - alone} by Newton's method "
                "from gaits of neighbours or from the seed's start."
            )

    def flush(self) -> None:
        """Writes to the store, where there is one, what is not there yet."""
        import zarr

        if self._path is None:
            return
        began = time.monotonic()
        with writing(self._path):
            group: Any = zarr.open_group(str(self._path), mode="r+", use_consolidated=False)
            # What says that points are known is written after what is known of them.
            names = [str(name) for name in self._dataset.data_vars if name != _DONE]
            for name in (*names, _DONE):
                group[name][...] = self._dataset[name].data
        self._written = time.monotonic()
        # All is written each time: that must not take longer than what is searched between.
        self._pause = max(_PAUSE, _SHARE * (self._written - began))


def open_gait_grid(
    first: Gait,
    values: Mapping[str, np.ndarray],
    quantities: Mapping[str, Quantity],
    settings: JsonObject,
    writer: Mapping[str, str],
    path: Path | None,
    *,
    any_version: bool,
) -> GaitGrid:
    """A grid without results, or what a store holds of it; see `continue_store`.

    Any gait of the sweep gives the shapes; `values` and `quantities` are those of the swept
    parameters. Without a path, the grid is kept in memory.
    """
    state = type(first.measures.state)
    dataset = _empty(first, values, quantities).assign_attrs(
        {**writer, SETTINGS: strict_json(settings)}
    )
    if path is None:
        return GaitGrid(dataset, state, None)
    new = continue_store(
        path,
        settings,
        writer,
        any_version=any_version,
        create=lambda half: dataset.to_zarr(str(half), consolidated=False, zarr_format=3),
    )
    return GaitGrid(dataset if new else _load(path, dataset), state, path)


def _load(path: Path, empty: "xarray.Dataset") -> "xarray.Dataset":
    """What a store holds; nothing where some of it was lost or damaged.

    Raises:
        ArgumentError: another version kept less in it.
    """
    import zarr

    stored = empty
    whole = False
    # What is damaged raises errors of its codec's own.
    with contextlib.suppress(Exception):
        stored = open_store(path).load()
        arrays = [each for _, each in zarr.open_group(str(path), mode="r").arrays()]
        whole = all(each.nchunks_initialized == each.nchunks for each in arrays)
        whole = whole or not bool(stored[_DONE].any())
    if not whole:
        warn(f"store = {str(path)!r} was damaged: its gaits are searched again.")
        return empty
    missing = sorted(set(map(str, empty.data_vars)) - set(map(str, stored.data_vars)))
    if missing:
        raise ArgumentError(
            f"store = {str(path)!r} was written by a version that kept no {missing[0]}: give it "
            "another store."
        )
    return stored


def _empty(
    gait: Gait, values: Mapping[str, np.ndarray], quantities: Mapping[str, Quantity]
) -> "xarray.Dataset":
    import xarray

    dims, shape = tuple(values), tuple(map(len, values.values()))
    variables: dict[str, Any] = {_DONE: (dims, np.zeros(shape, bool))}
    for name, (own, value, attributes) in variables_of(gait_entries(gait)).items():
        whole = value.dtype.kind in "ib"
        empty = np.full((*shape, *value.shape), -1 if whole else np.nan, value.dtype)
        variables[name] = ((*dims, *own), empty, attributes)
    coordinates: dict[str, Any] = {
        name: (name, column, quantities[name].attributes) for name, column in values.items()
    }
    return xarray.Dataset(variables, coordinates | gait_coordinates(gait))


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


def neighbours(place: Place, shape: Sequence[int], stride: int = 1) -> Iterator[Place]:
    """The points next to one, one axis after the other."""
    for axis, size in enumerate(shape):
        for step in (-stride, stride):
            moved = place[axis] + step
            if 0 <= moved < size:
                yield (*place[:axis], moved, *place[axis + 1 :])


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
