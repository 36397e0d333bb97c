"""Views of basins: a picture of labels, in which a start that is picked shows its walk."""

import dataclasses
import warnings
from typing import TYPE_CHECKING, Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError, check_count, check_type
from jaxbiped._types import JsonObject
from jaxbiped.basins._labels import label_names
from jaxbiped.plot.style import in_order, label_colour, view_colours
from jaxbiped.plot.viewer._recording import Recording, base64_of, record_walk
from jaxbiped.plot.viewer._view import AbstractPage
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._simulate import simulate
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep.starts._coordinates import coordinate_quantities
from jaxbiped.sweep.starts._starts import Grid

if TYPE_CHECKING:
    import xarray


@dataclasses.dataclass(frozen=True)
class BasinView(AbstractPage):
    """A picture of a basin in which a selected start shows its walk.

    Attributes:
        basin: the picture, ready for JSON.
        recordings: walks of the stored starts, row by row; None if a walk cannot be simulated.
    """

    basin: JsonObject
    recordings: tuple[Recording | None, ...]

    def sent(self) -> JsonObject:
        """Data of the page, ready for JSON."""
        walks = [each and each.numbers() for each in self.recordings]
        return {"basin": self.basin, "walks": walks, "colours": view_colours()}

    def _frame(self) -> tuple[str, int]:
        return self.basin["title"], 900

    _repr_html_ = AbstractPage._in_frame


def view_basin(
    labelling: Labelling,
    starts: Grid,
    found: "xarray.Dataset",
    *,
    most: int = 250,
    footsteps: int = 3,
    title: str = "Basin of attraction",
) -> BasinView:
    """Makes a picture of a basin in which a selected start shows its walk.

    The walks of evenly chosen starts are simulated at draft accuracy and stored in the page: their
    motion to 1e-4 of a leg's length, without forces.

    Args:
        labelling: labelling of the starts, of a compliant walker.
        starts: a grid with two axes, the second along the page.
        found: their labels, from `jaxbiped.sweep`.
        most: maximum number of walks to store, about 4 kB each.
        footsteps: number of footsteps of each walk.
        title: title of the picture.

    Returns:
        The view: `save(path)` writes it as one page of HTML, a notebook shows it in a frame.

    Raises:
        ArgumentError: an argument has the wrong type, the grid does not have two axes of at least
            two starts, the walker is rigid, or labels have another shape.
    """
    check_type("labelling", labelling, Labelling)
    check_type("starts", starts, Grid)
    check_count("most", most)
    check_count("footsteps", footsteps)
    if isinstance(labelling.scene, RigidScene):
        raise ArgumentError("labelling.scene is rigid, which is not allowed: give a compliant one.")
    if len(starts.shape) != 2 or min(starts.shape) < 2 or found.label.shape != starts.shape:
        raise ArgumentError(
            f"starts has shape {starts.shape} and found {found.label.shape}, which is not allowed: "
            "both must be of the same two axes, two starts or more along each."
        )
    rows, columns = _even_choice(starts.shape, most)
    numbers = np.ravel(rows[:, None] * starts.shape[1] + columns)
    words = label_names(found.label.values, found.cycle_footsteps.values)
    names = in_order(set(words.ravel().tolist()))
    y, x = starts.values
    quantities = coordinate_quantities(labelling.scene)
    labels = [
        f"{each.words} ({each.unit})" if each.unit else each.words
        for each in (quantities[x], quantities[y])
    ]
    # One that walks is shown at first, if there is one.
    walking = np.argwhere(np.char.startswith(words[np.ix_(rows, columns)].astype(str), "walking"))
    first = walking[len(walking) // 2, ::-1].tolist() if len(walking) else [0, 0]
    picture = {
        "title": title,
        "x": starts.values[x].tolist(),
        "y": starts.values[y].tolist(),
        "xLabel": labels[0],
        "yLabel": labels[1],
        "names": names,
        "colours": [label_colour(name) for name in names],
        "cells": base64_of(np.vectorize(names.index)(words), "<u1"),
        "columns": columns.tolist(),
        "rows": rows.tolist(),
        "first": first,
    }
    return BasinView(picture, tuple(_walks(labelling, starts, numbers, footsteps)))


def _even_choice(shape: tuple[int, ...], most: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of an even choice of at most so many starts, as many along each axis."""
    side = max(int(np.sqrt(most)), 1)
    counts = [min(side, size) for size in shape]
    for k in (0, 1):
        counts[k] = max(min(most // counts[1 - k], shape[k]), 1)
    rows, columns = (
        np.unique(np.round((np.arange(count) + 0.5) / count * size - 0.5).astype(int))
        for count, size in zip(counts, shape, strict=True)
    )
    return rows, columns


def _walks(
    labelling: Labelling, starts: Grid, numbers: np.ndarray, footsteps: int
) -> list[Recording | None]:
    batch = starts.at(labelling, numbers)
    found: list[Recording | None] = []
    for k in range(len(numbers)):
        here = {name: float(column[k]) for name, column in batch.parameters.items()}
        scene: Any = with_parameters(labelling.scene, here)
        state = jtu.tree_map(lambda leaf, k=k: leaf[k], batch.states)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                walk = simulate(scene, state, footsteps=footsteps, accuracy="draft")
            found.append(record_walk(scene, walk, "walk", motion_only=True))
        except ArgumentError:  # a start that no walk can have
            found.append(None)
    return found
