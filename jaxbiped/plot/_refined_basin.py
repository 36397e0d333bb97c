"""Refined basin picture: labels about a boundary, and the cells that it crosses."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.basins._refined_boundary import RefinedBoundary
from jaxbiped.plot import style
from jaxbiped.plot._basin import draw_labels, finish, names_of

_CORNERS = np.asarray([(0, 0), (1, 0), (1, 1), (0, 1)])


def refined_basin(
    boundary: RefinedBoundary,
    *,
    names: tuple[str | Quantity, str | Quantity],
    units: tuple[str, str] = ("", ""),
    codes: Mapping[int, str] | None = None,
    cells: bool = True,
    mark: tuple[float, float] | None = None,
    title: str = "",
    ax: Axes | None = None,
) -> Figure:
    """Draws the labels about a refined boundary, and outlines the cells that were halved.

    Fractions are those of the full grid of the finest level, its labels filled in as by
    `RefinedBoundary.on_grid`.

    Args:
        boundary: of two dimensions; x is the first.
        names, units: what the axes are, and in which units (see `basin`).
        codes: names of the label codes; those of `Label` unless given.
        cells: whether to outline the boundary cells of every level but the finest, which
            are those that were halved.
        mark: where the gait is, in the units of the axes.
        title: above the axes; how many labels were asked for unless given.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: not a refined boundary of two dimensions, or a code without a name.
    """
    check_type("boundary", boundary, RefinedBoundary)
    if len(boundary.shape) != 2:
        raise ArgumentError(f"boundary has {len(boundary.shape)} dimensions: it must have 2.")
    words = _words(boundary, codes)
    ax = style.axes_or_new(ax, 7.2, 4.4)
    draw_labels(ax, words, *(_edges(boundary, k) for k in (0, 1)))
    more: tuple[Line2D, ...] = ()
    if cells and boundary.levels:
        for level in range(boundary.levels):
            ax.add_collection(_outlines(boundary, level), autolim=False)
        more = (Line2D([], [], color="black", linewidth=0.6, label="halved cells"),)
    ax.set_xlim(boundary.lower[0], boundary.upper[0])
    ax.set_ylim(boundary.lower[1], boundary.upper[1])
    said = title or f"{boundary.asked} labels of the full grid's {boundary.full}"
    finish(ax, words, names, units, mark, said, more)
    return style.figure_of(ax)


def _words(boundary: RefinedBoundary, codes: Mapping[int, str] | None) -> np.ndarray:
    grid = boundary.on_grid().T
    if codes is None:
        return names_of(grid)
    nameless = sorted(set(boundary.labels.tolist()) - set(codes))
    if nameless:
        raise ArgumentError(f"codes has no name for label {nameless[0]}: each must have one.")
    return np.vectorize(codes.__getitem__, otypes=[object])(grid)


def _edges(boundary: RefinedBoundary, k: int) -> np.ndarray:
    """Edges of the cells around the lattice's points along a dimension."""
    half = 0.5 * boundary.cell_size(boundary.levels)[k]
    axis = boundary.axis(k)
    return np.concatenate([axis - half, axis[-1:] + half])


def _outlines(boundary: RefinedBoundary, level: int) -> PolyCollection:
    """The boundary cells of a level as rectangles; finer levels in thinner lines."""
    corners: npt.NDArray[np.float64] = boundary.lower + (
        boundary.cells[level][:, None] + _CORNERS
    ) * boundary.cell_size(level)
    return PolyCollection(
        list(corners), facecolors="none", edgecolors="black", linewidths=0.7 * 0.7**level
    )
