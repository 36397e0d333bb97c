"""Zarr store: results written a chunk at a time, continued where a killed run left off."""

import json
import os
import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._checks import ArgumentError, ResourceError, failure_kind
from jaxbiped._types import JsonObject
from jaxbiped.sweep._array_layout import Layout, empty_dataset
from jaxbiped.sweep._same_store import ALSO, GAITS, SETTINGS, check_same, check_writers
from jaxbiped.sweep._store import COMPLETE, AbstractStore

if TYPE_CHECKING:
    import xarray

_DONE = "done"


class ZarrStore(AbstractStore):
    """An open store on a disk. `open` makes a new one or continues one with the same settings.

    It holds what `xarray.open_zarr` opens: an array for each field, a coordinate for each axis,
    and `done`, which says for each chunk whether it is complete.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        import zarr

        self.path, self.layout = path, layout
        self._group: Any = zarr.open_group(str(path), mode="r+", use_consolidated=False)
        done: Any = self._group[_DONE]
        self._done = np.asarray(done[:])

    @staticmethod
    def open(
        path: Path,
        layout: Layout,
        settings: JsonObject,
        writer: Mapping[str, str],
        *,
        any_version: bool = False,
    ) -> "ZarrStore":
        """Opens a store.

        Args:
            path: of the store's directory.
            layout: of the results.
            settings: all that the labels depend on; those of a store that is there must be equal.
            writer: the `provenance` of what is written; a new store says it of itself.
            any_version: whether to continue what another version, revision or user's code wrote.
                The store then says that this one wrote in it, too.

        Raises:
            ArgumentError: the directory holds something else, or a store made with other settings
                or by another version, or may not be written.
            ResourceError: its disk is full or fails.
        """
        check_store(path)
        path = path.absolute()
        try:
            if _is_new(path):
                _create(path, layout, settings, writer)
            check_same(path, settings)
            new = check_writers(path, writer, any_version)
            store = ZarrStore(path, layout)
        except OSError as error:
            raise unwritable(path, error) from None
        if new:
            others = [*json.loads(store.noted(ALSO) or "[]"), dict(writer)]
            store.note({ALSO: json.dumps(others)})
        return store

    @staticmethod
    def check(
        path: Path, settings: JsonObject, writer: Mapping[str, str], *, any_version: bool
    ) -> None:
        """Refuses early what `open` would refuse; gaits may be missing from these settings.

        Raises:
            ArgumentError: see `open`.
        """
        path = path.absolute()
        try:
            if not _is_new(path):
                check_same(path, settings, but=GAITS)
                check_writers(path, writer, any_version)
        except OSError as error:
            raise unwritable(path, error) from None

    def missing(self) -> np.ndarray:
        return np.flatnonzero(self._done == 0)

    def behind(self, mark: int) -> np.ndarray:
        return np.flatnonzero(self._done < mark)

    def write(self, chunk: int, fields: Mapping[str, np.ndarray], *, mark: int = COMPLETE) -> None:
        region = self.layout.region(chunk)
        shape = self.layout.shape_of(chunk)
        try:
            if self._done[chunk]:
                # Were it killed amid writing, the chunk must not pass for complete.
                self._mark(chunk, 0)
            for name, values in fields.items():
                self._group[name][region] = np.reshape(values, shape)
            self._mark(chunk, mark)
        except OSError as error:
            raise unwritable(self.path, error) from None

    def _mark(self, chunk: int, complete: int) -> None:
        self._done[chunk] = complete
        self._group[_DONE][chunk] = complete

    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        region = self.layout.region(chunk)
        return {name: np.array(self._group[name][region]).ravel() for name in names}

    def note(self, attributes: Mapping[str, str | float]) -> None:
        try:
            self._group.attrs.update(dict(attributes))
            consolidate(self.path)
        except OSError as error:
            raise unwritable(self.path, error) from None

    def noted(self, name: str) -> str | None:
        text = self._group.attrs.get(name)
        return None if text is None else str(text)

    def dataset(self) -> "xarray.Dataset":
        return open_store(self.path)


def check_store(path: Path) -> None:
    """Raises `ArgumentError` where no store can be made or continued at this path."""
    _is_new(path)
    home = next(each for each in [path, *path.absolute().parents] if each.is_dir())
    if not os.access(home, os.W_OK | os.X_OK):
        raise ArgumentError(
            f"store = {str(path)!r} cannot be written: its folder must be writable."
        )


def open_store(path: Path) -> "xarray.Dataset":
    """The dataset of a store, read as it is needed."""
    import xarray

    return xarray.open_zarr(path, chunks=None)


def unwritable(path: Path, error: OSError) -> ArgumentError | ResourceError:
    """The sentence for a store that cannot be written."""
    why = (error.strerror or str(error)).lower()
    return failure_kind(error)(
        f"store = {str(path)!r} cannot be written ({why}): it must be a directory on a disk with "
        "room; the chunks that are complete stay."
    )


def _create(
    path: Path, layout: Layout, settings: JsonObject, attributes: Mapping[str, str]
) -> None:
    """A store without results, complete in itself or not there at all.

    Arrays take no room until they are written.
    """
    import zarr

    half = path.with_name(f".{path.name}.unfinished")
    shutil.rmtree(half, ignore_errors=True)
    try:
        half.parent.mkdir(parents=True, exist_ok=True)
        group = zarr.create_group(
            str(half), zarr_format=3, attributes={**attributes, SETTINGS: json.dumps(settings)}
        )
        for name, variable in empty_dataset(layout).variables.items():
            own = name not in layout.starts.axes
            array = group.create_array(
                str(name),
                shape=variable.shape,
                chunks=layout.chunk_shape if own else variable.shape,
                dtype=variable.dtype,
                fill_value=variable.values.flat[0] if own else None,
                dimension_names=list(map(str, variable.dims)),
                attributes=variable.attrs,
            )
            if not own:
                array[:] = variable.values
        done: JsonObject = {
            "long_name": "whether the chunk is complete; 2 after gaits were found late, more after "
            "rounds of finer tolerances"
        }
        group.create_array(
            _DONE,
            shape=(layout.chunks,),
            chunks=(layout.chunks,),
            dtype="i1",
            fill_value=0,
            dimension_names=["chunk"],
            attributes=done,
        )
        consolidate(half)
        if path.exists():
            path.rmdir()
        half.rename(path)
    except OSError:
        shutil.rmtree(half, ignore_errors=True)
        raise


def consolidate(path: Path) -> None:
    """Lets `xarray.open_zarr` read all arrays' metadata at once, without a warning."""
    import zarr

    with warnings.catch_warnings():
        # Zarr's third format has no word on it yet.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(str(path))


def _is_new(path: Path) -> bool:
    """Whether nothing is there yet, or an empty directory.

    Raises:
        ArgumentError: a file is there.
    """
    if path.exists() and not path.is_dir():
        raise ArgumentError(f"store = {str(path)!r} is a file: it must be a directory.")
    return not path.exists() or not any(path.iterdir())
