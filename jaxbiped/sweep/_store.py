"""Store of a sweep's results, written a chunk at a time, in memory or as Zarr on a disk.

One on a disk is continued where a killed run left off.
"""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxbiped._checks import warn
from jaxbiped._files import strict_json
from jaxbiped._types import JsonObject
from jaxbiped.sweep._store_files import SETTINGS, continue_store, note, open_store, writing
from jaxbiped.sweep._stored_fields import Layout, empty_dataset

if TYPE_CHECKING:
    import xarray

COMPLETE = 1
"""Mark of a chunk that was labelled."""
ALL_GAITS = 2
"""Mark of a chunk that was gone over again after gaits were found late. Each round of finer
tolerances after that counts one more."""
_DONE = "done"


class Store:
    """Fields of all starts, written and read a chunk at a time, and attributes of the whole.

    At an address it is what `xarray.open_zarr` opens: an array for each field, a coordinate for
    each axis, and `done`, which says how far each chunk is. In memory no chunk is ever complete
    beforehand.
    """

    def __init__(self, layout: Layout, data: Any, path: Path | None = None) -> None:
        """`data`: arrays by name and attributes, of a dataset in memory or of a group of Zarr."""
        self.layout, self.path, self._data = layout, path, data
        self._done = np.zeros(layout.chunks, np.int8)

    @staticmethod
    def in_memory(layout: Layout, settings: JsonObject, writer: Mapping[str, str]) -> "Store":
        dataset = empty_dataset(layout)
        dataset.attrs = {**writer, SETTINGS: strict_json(settings)}
        for name in dataset.data_vars:
            dataset[name].data = np.array(dataset[name].data)
        return Store(layout, dataset)

    @staticmethod
    def open(
        path: Path,
        layout: Layout,
        settings: JsonObject,
        writer: Mapping[str, str],
        *,
        any_version: bool = False,
    ) -> "Store":
        """A store on a disk, as `continue_store` makes it or goes on with it."""
        import zarr

        continue_store(
            path,
            settings,
            writer,
            any_version=any_version,
            create=lambda half: _write_empty(half, layout, settings, writer),
        )
        group = zarr.open_group(str(path), mode="r+", use_consolidated=False)
        store = Store(layout, group, path)
        with writing(path):
            store._recall_chunks()
        return store

    def _recall_chunks(self) -> None:
        """Takes chunks whose files are not all there and whole for not labelled yet."""
        assert self.path is not None
        # What is damaged raises errors of its codec's own.
        with contextlib.suppress(Exception):
            self._done = np.asarray(self._data[_DONE][:])
        known = {_DONE, *self.layout.starts.axes}
        names = [name for name in map(str, self._data.array_keys()) if name not in known]
        there = set(map(str, self.path.rglob("*")))
        lost = 0
        for chunk in map(int, np.flatnonzero(self._done)):
            place = [str(k) for k in self.layout.place(chunk)]
            files = [self.path.joinpath(name, "c", *place) for name in names]
            whole = all(str(file) in there for file in files)
            try:
                self.read(chunk, tuple(names) if whole else ())
            except Exception:  # as above
                whole = False
            if not whole:
                for file in files:
                    file.unlink(missing_ok=True)
                self._mark(chunk, 0)
                lost += 1
        if lost:
            warn(
                f"store = {str(self.path)!r}: {lost} of its chunks were lost or damaged; their "
                "starts are labelled again.",
            )

    def behind(self, mark: int = COMPLETE) -> np.ndarray:
        """Numbers of the chunks whose mark is below this one."""
        return np.flatnonzero(self._done < mark)

    def write(self, chunk: int, fields: Mapping[str, np.ndarray], *, mark: int = COMPLETE) -> None:
        """Writes a chunk, then marks how far it is; raises as `writing`."""
        region, shape = self.layout.region(chunk), self.layout.shape_of(chunk)
        with contextlib.nullcontext() if self.path is None else writing(self.path):
            if self._done[chunk]:
                # Were it killed amid writing, the chunk must not pass for complete.
                self._mark(chunk, 0)
            for name, values in fields.items():
                self._data[name][region] = np.reshape(values, shape)
            self._mark(chunk, mark)

    def _mark(self, chunk: int, complete: int) -> None:
        self._done[chunk] = complete
        if self.path is not None:
            # All of them: another client of the same store may have written without its own.
            self._data[_DONE][:] = self._done

    def read(self, chunk: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """These fields of one chunk, flat arrays of one's own."""
        region = self.layout.region(chunk)
        return {name: np.array(self._data[name][region]).ravel() for name in names}

    def note(self, attributes: Mapping[str, str | float]) -> None:
        """Sets attributes; raises as `writing`."""
        if self.path is None:
            self._data.attrs.update(attributes)
        else:
            with writing(self.path):
                note(self.path, attributes)

    def noted(self, name: str) -> str | None:
        """An attribute that is a text, None where it is not there."""
        attributes = self.dataset().attrs
        return str(attributes[name]) if name in attributes else None

    def dataset(self) -> "xarray.Dataset":
        """The results; those on a disk are opened lazily."""
        found: xarray.Dataset = self._data if self.path is None else open_store(self.path)
        return found


def _write_empty(
    path: Path, layout: Layout, settings: JsonObject, attributes: Mapping[str, str]
) -> None:
    """A store without results. Arrays take no room until they are written."""
    import xarray
    import zarr

    group = zarr.create_group(
        str(path), zarr_format=3, attributes={**attributes, SETTINGS: strict_json(settings)}
    )
    done = xarray.Variable(
        "chunk",
        np.zeros(layout.chunks, np.int8),
        {
            "long_name": "whether the chunk is complete; 2 after gaits were found late, more after "
            "rounds of finer tolerances"
        },
    )
    for name, variable in {**empty_dataset(layout).variables, _DONE: done}.items():
        cut = name != _DONE and name not in layout.starts.axes
        array = group.create_array(
            str(name),
            shape=variable.shape,
            chunks=layout.chunk_shape if cut else variable.shape,
            dtype=variable.dtype,
            fill_value=variable.values.flat[0] if cut else None,
            dimension_names=list(map(str, variable.dims)),
            attributes=variable.attrs,
        )
        if not cut:
            array[:] = variable.values
