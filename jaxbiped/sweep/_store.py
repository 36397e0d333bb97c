"""Store of a sweep's results, by chunks of starts: its arrays, in memory or as Zarr on a disk.

One on a disk is continued where a killed run left off.
"""

import contextlib
import enum
import functools
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxbiped._checks import warn
from jaxbiped._ending import endings_named
from jaxbiped._files import strict_json
from jaxbiped._quantity import Quantity
from jaxbiped._types import JsonObject
from jaxbiped.basins._labels import ENDINGS, PERIODIC, Doubt, Label, Witness
from jaxbiped.sweep._label_recorders import Labelled
from jaxbiped.sweep._store_files import SETTINGS, continue_store, note, open_store, writing
from jaxbiped.sweep.starts._starts import AbstractStarts, Batch

if TYPE_CHECKING:
    import xarray

COMPLETE = 1
"""Mark of a chunk that was labelled."""
ALL_GAITS = 2
"""Mark of a chunk that was gone over again after gaits were found late. Each round of finer
tolerances after that counts one more."""
_DONE = "done"
FIELDS: dict[str, tuple[str, float, str, str]] = {
    "label": ("i1", int(Label.PENDING), "", "what became of the start"),
    "gait": ("i2", -1, "", "position of the gait that it converges to"),
    "cycle_footsteps": ("i2", 0, "footsteps", "cycle of the gait that it converges to"),
    "footsteps": ("i4", 0, "", "heel strikes until the label was certain"),
    "time": ("f8", np.nan, "s", "simulated time until the label was certain"),
    "distance": ("f8", np.nan, "m", "distance walked until the label was certain"),
    "rate": ("f8", np.nan, "", "share of the distance from the gait left after a footstep"),
    "closest": ("f8", np.nan, "", "smallest distance from a gait, in its metric"),
    "attempted": ("i4", 0, "", "attempted steps of the solver"),
}
"""Of each field: dtype, value before it is known, unit, and what it is."""
DOUBT_FIELDS: dict[str, tuple[str, float, str, str]] = {
    "doubt": ("i1", int(Doubt.NONE), "", "whether the label was in doubt, and is"),
    "disagreed": ("i1", 0, "", "which solves gave another label than the first one"),
    "changed": ("i1", 0, "", "whether finer tolerances gave another label than the first one"),
}
"""Further ones, of labels whose accuracy was asked for by a number."""
_FLAGS: dict[str, tuple[str, type[enum.IntEnum] | type[enum.IntFlag]]] = {
    "label": ("flag_values", Label),
    "doubt": ("flag_values", Doubt),
    "disagreed": ("flag_masks", Witness),
}


class Layout(NamedTuple):
    """Arrays for starts of some shape, cut into chunks of starts that follow each other.

    Attributes:
        starts: the starts.
        chunk_shape: of all chunks but those at the far end of the axis that is cut: one place of
            the axes before it, all of those after.
        quantities: what the starts' coordinates are, as far as it is known.
        doubts: whether `DOUBT_FIELDS` are kept.
        endings: names of the endings of a hybrid system; None for a walker.
    """

    starts: AbstractStarts
    chunk_shape: tuple[int, ...]
    quantities: Mapping[str, Quantity]
    doubts: bool = False
    endings: tuple[str, ...] | None = None

    @staticmethod
    def of(
        starts: AbstractStarts,
        chunk: int,
        quantities: Mapping[str, Quantity] | None = None,
        *,
        doubts: bool = False,
        endings: tuple[str, ...] | None = None,
    ) -> "Layout":
        """With at most `chunk` starts in a chunk."""
        shape, left = [], chunk
        for size in reversed(starts.shape):
            shape.append(max(1, min(left, size)))
            left = left // size if left >= size else 1
        return Layout(starts, tuple(reversed(shape)), quantities or {}, doubts, endings)

    @property
    def fields(self) -> dict[str, tuple[str, float, str, str]]:
        """What is kept of each start beside its own coordinates."""
        return FIELDS | DOUBT_FIELDS if self.doubts else FIELDS

    @property
    def _counts(self) -> tuple[int, ...]:
        """How many chunks lie along each axis."""
        pairs = zip(self.starts.shape, self.chunk_shape, strict=True)
        return tuple(-(-size // length) for size, length in pairs)

    @property
    def chunks(self) -> int:
        return math.prod(self._counts)

    def place(self, chunk: int) -> tuple[int, ...]:
        """Of a chunk among the others, along each axis."""
        return tuple(map(int, np.unravel_index(chunk, self._counts)))

    def region(self, chunk: int) -> tuple[slice, ...]:
        """Where a chunk lies in the arrays."""
        sizes = zip(self.place(chunk), self.chunk_shape, self.starts.shape, strict=True)
        return tuple(slice(k * part, min((k + 1) * part, size)) for k, part, size in sizes)

    def shape_of(self, chunk: int) -> tuple[int, ...]:
        return tuple(part.stop - part.start for part in self.region(chunk))

    def numbers(self, chunk: int) -> tuple[int, int]:
        """The first of its starts, and the one after its last."""
        corner = [part.start for part in self.region(chunk)]
        first = int(np.ravel_multi_index(corner, self.starts.shape))
        return first, first + math.prod(self.shape_of(chunk))

    @property
    def sizes(self) -> np.ndarray:
        """How many starts each chunk has, shape (chunks,)."""
        along = zip(self._counts, self.chunk_shape, self.starts.shape, strict=True)
        lengths = [np.minimum(part, size - part * np.arange(n)) for n, part, size in along]
        return np.asarray(functools.reduce(np.multiply.outer, lengths)).ravel()


def fields_of(starts: AbstractStarts, found: Labelled, batch: Batch) -> dict[str, np.ndarray]:
    """What is kept of some starts, flat arrays by name."""
    names = FIELDS if found.doubt is None else FIELDS | DOUBT_FIELDS
    fields = {name: getattr(found, name) for name in names}
    return fields | {f"start_{name}": batch.columns[name] for name in starts.own_columns}


def empty_dataset(layout: Layout) -> "xarray.Dataset":
    """The results before any is known; the arrays take no memory."""
    import xarray

    starts = layout.starts
    dims = tuple(starts.axes)
    kinds = dict(layout.fields)
    for name in starts.own_columns:
        own = layout.quantities.get(name, Quantity(name))
        kinds[f"start_{name}"] = ("f8", np.nan, own.unit, f"the start's {own.words}")
    variables = {}
    for name, (dtype, nothing, unit, what) in kinds.items():
        attributes: JsonObject = {"long_name": what}
        if unit:
            attributes["units"] = unit
        if name in _FLAGS:
            kind, members = _FLAGS[name]
            flags: list[Any] = list(members)
            if name == "label" and layout.endings is not None:
                flags += [each for each in endings_named(layout.endings) if each not in flags]
                attributes[ENDINGS] = json.dumps(layout.endings)
            attributes[kind] = [int(each.value) for each in flags]
            words = [str(each.name).lower() for each in flags]
            if ENDINGS in attributes:
                words[flags.index(Label.WALKING)] = PERIODIC
            attributes["flag_meanings"] = " ".join(words)
        values = np.broadcast_to(np.asarray(nothing, dtype=dtype), starts.shape)
        variables[name] = (dims, values, attributes)
    coordinates = {
        name: (name, values, layout.quantities.get(name, Quantity(name)).attributes)
        for name, values in starts.axes.items()
        if values is not None
    }
    return xarray.Dataset(variables, coordinates)


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
    def of(
        path: Path | None,
        layout: Layout,
        settings: JsonObject,
        writer: Mapping[str, str],
        *,
        any_version: bool = False,
    ) -> "Store":
        """A store in memory; at a path, as `continue_store` makes it or goes on with it."""
        attributes = {**writer, SETTINGS: strict_json(settings)}
        if path is None:
            return Store(layout, empty_dataset(layout).assign_attrs(attributes).copy(deep=True))
        import zarr

        create = functools.partial(_write_empty, layout, attributes)
        continue_store(path, settings, writer, any_version=any_version, create=create)
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
        return self._data if self.path is None else open_store(self.path)


def _write_empty(layout: Layout, attributes: Mapping[str, str], path: Path) -> None:
    """A store without results. Arrays take no room until they are written."""
    import xarray
    import zarr

    group = zarr.create_group(str(path), zarr_format=3, attributes=dict(attributes))
    words = (
        "whether the chunk is complete; 2 after gaits were found late, more after rounds of finer "
        "tolerances"
    )
    done = xarray.Variable("chunk", np.zeros(layout.chunks, np.int8), {"long_name": words})
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
