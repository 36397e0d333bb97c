"""Gaits on a grid of parameters as a dataset, in memory or in a Zarr store."""

import contextlib
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

_DONE = "done"
_PAUSE = 2.0
"""Seconds between two writes of a store, at least."""
_SHARE = 20.0
"""How much longer than a write takes."""


class GaitGrid:
    """Results of a sweep of gaits, written point by point."""

    def __init__(self, dataset: "xarray.Dataset", state: type, path: Path | None) -> None:
        self._dataset, self._state, self._path = dataset, state, path
        self._written, self._pause = time.monotonic(), _PAUSE

    def is_done(self, place: tuple[int, ...]) -> bool:
        """Whether it is known what a point has, a gait or none."""
        return bool(self._dataset[_DONE].data[place])

    def is_stable(self, place: tuple[int, ...]) -> bool:
        return bool(self._dataset["spectral_radius"].data[place] < 1.0)

    def states(self) -> np.ndarray:
        """States without `ROOT_x` at all points, shape (*grid, m); NaN where there is no gait."""
        names = recurring_names(self._state)
        return np.stack([self._dataset[f"state_{name}"].data for name in names], axis=-1)

    def write(self, places: Sequence[tuple[int, ...]], gaits: Gait) -> None:
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

    Args:
        first: any gait of the sweep, for the shapes.
        values, quantities: of the swept parameters.
        settings, writer, any_version: as there.
        path: of the store; None for one in memory.
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
        warn(
            f"store = {str(path)!r} was damaged: its gaits are searched again.",
        )
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
