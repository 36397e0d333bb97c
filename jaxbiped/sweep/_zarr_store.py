"""Zarr store: results written a chunk at a time, continued where a killed run left off."""

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._files import strict_json
from jaxbiped._types import JsonObject
from jaxbiped.sweep._store import COMPLETE, AbstractStore
from jaxbiped.sweep._store_files import (
    GAITS,
    SETTINGS,
    check_same,
    check_store,
    check_writers,
    consolidate,
    create_store,
    is_new,
    open_store,
    writing,
)
from jaxbiped.sweep._stored_fields import Layout, empty_dataset

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
        try:
            done: Any = self._group[_DONE]
            self._done = np.asarray(done[:])
        except Exception:  # damaged, of which each codec has errors of its own
            self._done = np.zeros(layout.chunks, np.int8)
        self._forget_lost()

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
        with writing(path):
            if is_new(path):
                create_store(path, lambda half: _write_empty(half, layout, settings, writer))
            check_same(path, settings)
            new = check_writers(path, writer, any_version)
            store = ZarrStore(path, layout)
        if new:
            store.note(new)
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
        with writing(path):
            if not is_new(path):
                check_same(path, settings, but=GAITS)
                check_writers(path, writer, any_version)

    def _forget_lost(self) -> None:
        """Takes chunks whose files are not all there and whole for not labelled yet."""
        names = [name for name in map(str, self._group.array_keys()) if self._is_cut(name)]
        lost = 0
        for chunk in np.flatnonzero(self._done):
            places = [part.start // n for part, n in self._cuts(int(chunk))]
            files = [self.path.joinpath(name, "c", *map(str, places)) for name in names]
            try:
                whole = all(file.exists() for file in files)
                self.read(int(chunk), tuple(names) if whole else ())
            except Exception:  # as above
                whole = False
            if not whole:
                for file in files:
                    file.unlink(missing_ok=True)
                self._mark(int(chunk), 0)
                lost += 1
        if lost:
            warnings.warn(
                f"store = {str(self.path)!r}: {lost} of its chunks were lost or damaged; their "
                "starts are labelled anew.",
                RuntimeWarning,
                stacklevel=4,
            )

    def _cuts(self, chunk: int) -> Iterator[tuple[slice, int]]:
        return zip(self.layout.region(chunk), self.layout.chunk_shape, strict=True)

    def _is_cut(self, name: str) -> bool:
        return name != _DONE and name not in self.layout.starts.axes

    def missing(self) -> np.ndarray:
        return np.flatnonzero(self._done == 0)

    def behind(self, mark: int) -> np.ndarray:
        return np.flatnonzero(self._done < mark)

    def write(self, chunk: int, fields: Mapping[str, np.ndarray], *, mark: int = COMPLETE) -> None:
        import zarr

        region, shape = self.layout.region(chunk), self.layout.shape_of(chunk)
        with writing(self.path):
            if self._done[chunk]:
                # Were it killed amid writing, the chunk must not pass for complete.
                self._mark(chunk, 0)
            # A chunk that is not there is one that was lost, whatever it held.
            with zarr.config.set({"array.write_empty_chunks": True}):
                for name, values in fields.items():
                    self._group[name][region] = np.reshape(values, shape)
            self._mark(chunk, mark)

    def _mark(self, chunk: int, complete: int) -> None:
        self._done[chunk] = complete
        # All of them: another client that fills the same store may have written without its own.
        self._group[_DONE][:] = self._done

    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        region = self.layout.region(chunk)
        return {name: np.array(self._group[name][region]).ravel() for name in names}

    def note(self, attributes: Mapping[str, str | float]) -> None:
        with writing(self.path):
            self._group.attrs.update(dict(attributes))
            consolidate(self.path)

    def noted(self, name: str) -> str | None:
        text = self._group.attrs.get(name)
        return None if text is None else str(text)

    def dataset(self) -> "xarray.Dataset":
        return open_store(self.path)


def _write_empty(
    path: Path, layout: Layout, settings: JsonObject, attributes: Mapping[str, str]
) -> None:
    """A store without results. Arrays take no room until they are written."""
    import zarr

    group = zarr.create_group(
        str(path), zarr_format=3, attributes={**attributes, SETTINGS: strict_json(settings)}
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
