"""Results in a Zarr store: written a chunk at a time, continued where a killed run left off."""

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr

from jaxbiped._checks import ArgumentError
from jaxbiped.sweep._layout import FIELDS, Layout, empty_dataset

SETTINGS = "settings"
"""Attribute that holds, as JSON, all that the labels depend on."""
_DONE = "done"
_CLOSE = 1e-6
"""Relative difference of two gaits' numbers that counts as none."""


class Store:
    """An open store. `Store.open` makes a new one or continues one with the same settings.

    It holds what `xarray.open_zarr` opens: an array for each field, a coordinate for each axis,
    and `done`, which says for each chunk whether it is complete.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path, self.layout = path, layout
        self._group: Any = zarr.open_group(str(path), mode="r+", use_consolidated=False)

    @staticmethod
    def open(
        path: Path, layout: Layout, settings: dict[str, Any], attributes: Mapping[str, Any]
    ) -> "Store":
        """Opens a store.

        Args:
            path: of the store's directory.
            layout: of the results.
            settings: all that the labels depend on; those of a store that is there must be equal.
            attributes: what else a new store says of itself.

        Raises:
            ArgumentError: the directory holds something else, or a store made with other settings,
                or cannot be written.
        """
        check_store(path)
        try:
            if not path.exists() or not any(path.iterdir()):
                _create(path, layout, settings, attributes)
            _check_same(path, settings)
            return Store(path, layout)
        except OSError as error:
            raise unwritable(path, error) from None

    def missing(self) -> list[int]:
        """Numbers of the chunks that are not complete."""
        return [int(i) for i in np.flatnonzero(np.asarray(self._group[_DONE][:]) == 0)]

    def write(self, chunk: int, fields: Mapping[str, np.ndarray]) -> None:
        """Writes a chunk, then marks it as complete.

        Raises:
            ArgumentError: it cannot be written; what was written before stays.
        """
        region = self.layout.region(chunk)
        shape = self.layout.shape_of(chunk)
        try:
            for name, values in fields.items():
                self._group[name][region] = np.reshape(values, shape)
            self._group[_DONE][chunk] = 1
        except OSError as error:
            raise unwritable(self.path, error) from None

    def chunks(self, names: tuple[str, ...]) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
        """All chunks one by one: their numbers and these fields of theirs, flat."""
        for chunk in range(self.layout.chunks):
            yield chunk, self.read(chunk, names)

    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """These fields of one chunk, flat."""
        region = self.layout.region(chunk)
        return {name: np.asarray(self._group[name][region]).ravel() for name in names}

    def note(self, attributes: Mapping[str, Any]) -> None:
        """Sets attributes."""
        self._group.attrs.update(dict(attributes))
        zarr.consolidate_metadata(str(self.path), zarr_format=2)

    def dataset(self) -> xr.Dataset:
        """The results, opened lazily."""
        return opened(self.path)


def check_store(path: Path) -> None:
    """Raises `ArgumentError` where no store can be made or continued at this path."""
    if path.exists() and not path.is_dir():
        raise ArgumentError(f"store = {str(path)!r} is a file: it must be a directory.")
    home = next(each for each in [path, *path.absolute().parents] if each.is_dir())
    if not os.access(home, os.W_OK | os.X_OK):
        raise ArgumentError(
            f"store = {str(path)!r} cannot be written: its folder must be writable."
        )


def opened(path: Path) -> xr.Dataset:
    """The dataset of a store, read as it is needed."""
    return xr.open_zarr(path, chunks=None)


def unwritable(path: Path, error: OSError) -> ArgumentError:
    """The sentence for a store that cannot be written."""
    why = (error.strerror or str(error)).lower()
    return ArgumentError(
        f"store = {str(path)!r} cannot be written ({why}): it must be a directory on a disk with "
        "room; the chunks that are complete stay."
    )


def _create(
    path: Path, layout: Layout, settings: dict[str, Any], attributes: Mapping[str, Any]
) -> None:
    """A store without results, complete in itself or not there at all."""
    dataset = empty_dataset(layout)
    done = np.zeros(layout.chunks, dtype=np.int8)
    dataset[_DONE] = ("chunk", done, {"long_name": "whether the chunk is complete"})
    dataset.attrs = {**attributes, SETTINGS: json.dumps(settings)}
    encoding = {name: {"chunks": layout.chunk_shape} for name in FIELDS if name in dataset}
    half = path.with_name(path.name + ".new")
    half.parent.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(half, ignore_errors=True)
    dataset.to_zarr(half, mode="w", encoding=encoding, zarr_format=2, consolidated=True)
    if path.exists():
        path.rmdir()
    half.rename(path)


def _check_same(path: Path, settings: dict[str, Any]) -> None:
    try:
        group = zarr.open_group(str(path), mode="r", use_consolidated=False)
        stored = json.loads(str(group.attrs[SETTINGS]))
    except (KeyError, ValueError, zarr.errors.GroupNotFoundError, FileNotFoundError):
        raise ArgumentError(
            f"store = {str(path)!r} holds something else: it must be a new directory, or a store "
            "of the same sweep."
        ) from None
    difference = _difference(stored, json.loads(json.dumps(settings)), "")
    if difference is not None:
        raise ArgumentError(
            f"store = {str(path)!r} was made with other settings: {difference}; give it those, or "
            "another store."
        )


def _difference(old: Any, new: Any, name: str) -> str | None:
    """The first difference of two settings in words, None for none."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted({*old, *new}):
            inner = f"{name}.{key}" if name else key
            if key not in old or key not in new:
                here = "only in the store" if key in old else "not in the store"
                return f"{inner} is {here}"
            found = _difference(old[key], new[key], inner)
            if found is not None:
                return found
        return None
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        found_ = (_difference(a, b, f"{name}[{i}]") for i, (a, b) in pairs)
        return next((each for each in found_ if each is not None), None)
    if old == new or _is_close(old, new, name):
        return None
    return f"{name} = {_shown(old)} there, {_shown(new)} here"


def _is_close(old: Any, new: Any, name: str) -> bool:
    """Gaits are found anew by each run, to their tolerance."""
    numbers = isinstance(old, float) and isinstance(new, float)
    own = name.startswith("gaits")
    return numbers and own and abs(old - new) <= _CLOSE * max(1e-3, abs(old))


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) < 60 else f"{text[:57]}..."
