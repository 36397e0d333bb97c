"""How the results of a sweep lie in arrays, and how these are cut into chunks."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from jaxbiped.sweep._coordinates import UNITS
from jaxbiped.sweep._label import Label
from jaxbiped.sweep._labelling import Labelled
from jaxbiped.sweep._starts import AbstractStarts, Batch

FIELDS: dict[str, tuple[str, Any, str, str]] = {
    "label": ("i1", int(Label.PENDING), "", "what became of the start"),
    "gait": ("i2", -1, "", "position of the gait that it converges to"),
    "period": ("i2", 0, "footsteps", "cycle of the gait that it converges to"),
    "footsteps": ("i4", 0, "", "heel strikes until the label was certain"),
    "time": ("f8", np.nan, "s", "simulated time until the label was certain"),
    "distance": ("f8", np.nan, "m", "distance walked until the label was certain"),
    "rate": ("f8", np.nan, "", "share of the distance from the gait left after a footstep"),
    "closest": ("f8", np.nan, "", "smallest distance from a gait, in its metric"),
    "attempts": ("i4", 0, "", "attempted steps of the solver"),
}
"""Of each field: dtype, value before it is known, unit, and what it is."""


class Layout(NamedTuple):
    """Arrays for starts of some shape, cut into chunks along their first axis.

    Attributes:
        starts: the starts.
        rows: of the first axis in a chunk.
    """

    starts: AbstractStarts
    rows: int

    @staticmethod
    def of(starts: AbstractStarts, chunk: int) -> "Layout":
        """With about `chunk` starts in a chunk, whole rows of the first axis."""
        row = starts.size // starts.shape[0]
        return Layout(starts, max(1, min(chunk // row, starts.shape[0])))

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.starts.shape[0] // self.rows)

    @property
    def chunk_shape(self) -> tuple[int, ...]:
        """Of all but the last."""
        return (self.rows, *self.starts.shape[1:])

    def region(self, chunk: int) -> tuple[slice, ...]:
        """Where a chunk lies in the arrays."""
        first = chunk * self.rows
        last = min(first + self.rows, self.starts.shape[0])
        return (slice(first, last), *[slice(None)] * (len(self.starts.shape) - 1))

    def shape_of(self, chunk: int) -> tuple[int, ...]:
        """Of a chunk."""
        rows = self.region(chunk)[0]
        return (rows.stop - rows.start, *self.starts.shape[1:])

    def numbers(self, chunk: int) -> tuple[int, int]:
        """The first of its starts, and the one after its last."""
        row = self.starts.size // self.starts.shape[0]
        rows = self.region(chunk)[0]
        return rows.start * row, rows.stop * row

    @property
    def own_columns(self) -> tuple[str, ...]:
        """Coordinates that each start has for itself: those of samples."""
        described = self.starts.described()
        if "sample" in described:
            return tuple(self.starts.lower)  # type: ignore[attr-defined]
        if "given" in described:
            return tuple(self.starts.states._fields)  # type: ignore[attr-defined]
        return ()


def fields_of(layout: Layout, found: Labelled, batch: Batch) -> dict[str, np.ndarray]:
    """What is kept of a chunk, flat arrays by name."""
    fields = {name: getattr(found, name) for name in FIELDS}
    return fields | {f"start_{name}": batch.columns[name] for name in layout.own_columns}


def empty_dataset(layout: Layout) -> xr.Dataset:
    """The results before any is known; the arrays take no memory."""
    starts = layout.starts
    dims = tuple(starts.axes)
    kinds = dict(FIELDS)
    for name in layout.own_columns:
        kinds[f"start_{name}"] = ("f8", np.nan, UNITS.get(name, ""), f"the start's {name}")
    variables = {}
    for name, (dtype, nothing, unit, what) in kinds.items():
        attributes: dict[str, Any] = {"long_name": what}
        if unit:
            attributes["units"] = unit
        if name == "label":
            attributes["flag_values"] = [int(label) for label in Label]
            attributes["flag_meanings"] = " ".join(str(each).replace(" ", "_") for each in Label)
        values = np.broadcast_to(np.asarray(nothing, dtype=dtype), starts.shape)
        variables[name] = (dims, values, attributes)
    coordinates = {
        name: (name, values, {"units": UNITS.get(name, "")})
        for name, values in starts.axes.items()
        if values is not None
    }
    return xr.Dataset(variables, coordinates)
