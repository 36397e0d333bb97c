"""Array layout of a sweep's results, and how it is cut into chunks."""

import enum
import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jaxbiped._quantity import Quantity
from jaxbiped._types import JsonObject
from jaxbiped.basins._labels import Doubt, Label, Witness
from jaxbiped.sweep._labelling_loop import Labelled
from jaxbiped.sweep.starts._starts import AbstractStarts, Batch

if TYPE_CHECKING:
    import xarray

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
    """

    starts: AbstractStarts
    chunk_shape: tuple[int, ...]
    quantities: Mapping[str, Quantity]
    doubts: bool = False

    @staticmethod
    def of(
        starts: AbstractStarts,
        chunk: int,
        quantities: Mapping[str, Quantity] | None = None,
        *,
        doubts: bool = False,
    ) -> "Layout":
        """With at most `chunk` starts in a chunk."""
        shape, left = [], chunk
        for size in reversed(starts.shape):
            shape.append(max(1, min(left, size)))
            left = left // size if left >= size else 1
        return Layout(starts, tuple(reversed(shape)), quantities or {}, doubts)

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
            kind, flags = _FLAGS[name]
            attributes[kind] = [int(each) for each in flags]
            attributes["flag_meanings"] = " ".join(str(each.name).lower() for each in flags)
        values = np.broadcast_to(np.asarray(nothing, dtype=dtype), starts.shape)
        variables[name] = (dims, values, attributes)
    coordinates = {
        name: (name, values, layout.quantities.get(name, Quantity(name)).attributes)
        for name, values in starts.axes.items()
        if values is not None
    }
    return xarray.Dataset(variables, coordinates)
