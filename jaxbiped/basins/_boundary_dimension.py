"""Box-counting dimension of the boundary between basins."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError
from jaxbiped.basins._arguments import check_label_grid, check_whole
from jaxbiped.basins._power_law import fit_exponent
from jaxbiped.basins._refined_boundary import RefinedBoundary


class Dimension(NamedTuple):
    """A box-counting dimension, with what it was fitted to.

    Attributes:
        estimate: the dimension.
        error: standard error of the fit's slope; it says nothing of a curvature of the counts.
        sizes: sides of the boxes, shape (k,), in cells of the finest grid.
        counts: how many boxes of each size hold a boundary, shape (k,).
    """

    estimate: float
    error: float
    sizes: np.ndarray
    counts: np.ndarray


def boundary_dimension(
    boundary: RefinedBoundary | npt.ArrayLike, *, skip: int = 0, sides: Sequence[int] | None = None
) -> Dimension:
    """N boxes of side s hold the boundary, N ~ s^−D: least squares of log N against log s.

    Box counting on basins: McDonald, Grebogi, Ott and Yorke, "Fractal basin boundaries", Physica
    D 17 (1985) 125, section 2. A box holds the boundary where the labelled points in it, those
    on its faces included, have more than one label; of a `RefinedBoundary` where it contains one
    of the finest boundary cells, its sizes being those of the levels.

    Args:
        boundary: a refined boundary, or a grid of label codes of any dimension.
        skip: how many of the largest sizes to leave out of the fit.
        sides: sides of the boxes on a label grid [grid spacings]; unless given powers of two, up
            to a quarter of the shortest axis. The far ends of a grid that does not hold a whole
            number of the largest boxes are left out.

    Returns:
        The dimension with its standard error, and the boxes counted at each side.

    Raises:
        ArgumentError: no boundary at three sizes, sides with a refined boundary, a side larger
            than the grid or not dividing the largest, or an argument that is not allowed.
    """
    check_whole("skip", skip, 0)
    if isinstance(boundary, RefinedBoundary):
        if sides is not None:
            raise ArgumentError(f"sides = {sides} is not allowed: the levels must set the sizes.")
        sizes, counts = _refined_counts(boundary)
    else:
        sizes, counts = _grid_counts(check_label_grid(boundary), sides)
    fitted = slice(None, len(sizes) - skip if skip < len(sizes) else 0)
    slope = fit_exponent(sizes[fitted], counts[fitted], "boundary")
    return Dimension(-slope.estimate, slope.error, sizes, counts)


def _refined_counts(boundary: RefinedBoundary) -> tuple[np.ndarray, np.ndarray]:
    finest = boundary.cells[-1]
    halvings = np.arange(boundary.levels + 1)
    counts = [len(np.unique(finest >> k, axis=0)) for k in halvings]
    return 2**halvings, np.asarray(counts)


def _grid_counts(labels: np.ndarray, sides: Sequence[int] | None) -> tuple[np.ndarray, np.ndarray]:
    shortest = min(labels.shape) - 1
    if sides is None:
        sizes = 2 ** np.arange(max(int(np.log2(max(shortest // 4, 1))) + 1, 1))
    else:
        sizes = np.unique([check_whole("sides", side, 1) for side in sides])
    largest = int(sizes[-1])
    if largest > shortest or (largest % sizes).any():
        raise ArgumentError(
            f"sides = {sizes.tolist()} is not allowed: each must divide the largest, and that be "
            f"at most {shortest}, the shortest axis of the grid."
        )
    whole = tuple(slice((n - 1) // largest * largest + 1) for n in labels.shape)
    counts = [_mixed_boxes(labels[whole], int(side)) for side in sizes]
    return sizes, np.asarray(counts)


def _mixed_boxes(labels: np.ndarray, side: int) -> int:
    """How many boxes of `side` spacings hold more than one label, faces included."""
    low = high = labels
    for axis in range(labels.ndim):
        low = _over_segments(np.minimum, low, axis, side)
        high = _over_segments(np.maximum, high, axis, side)
    return int((low != high).sum())


def _over_segments(fold: np.ufunc, values: np.ndarray, axis: int, side: int) -> np.ndarray:
    """Minima or maxima over segments of an axis that share their ends."""
    values = np.moveaxis(values, axis, 0)
    starts = np.arange(0, len(values) - 1, side)
    folded = fold(fold.reduceat(values[:-1], starts, axis=0), values[side::side])
    return np.moveaxis(folded, 0, axis)
