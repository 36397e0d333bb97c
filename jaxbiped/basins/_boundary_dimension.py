"""Dimension of the boundary between basins: by box counting, and by the uncertainty exponent."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_count, check_positive
from jaxbiped.basins._label_oracle import (
    LabelOf,
    LabelOracle,
    check_box,
    check_vector,
    normalise,
    spread_points,
)
from jaxbiped.basins._labels import check_label_grid
from jaxbiped.basins._refined_boundary import RefinedBoundary


class Exponent(NamedTuple):
    """Exponent of a power law and its standard error."""

    estimate: float
    error: float


def fit_exponent(x: np.ndarray, y: np.ndarray, what: str) -> Exponent:
    """Exponent p of y ~ x^p: the slope of log y against log x, of shape (n,), by least squares.

    The standard error is that of a slope whose scatter is seen in the residuals (n − 2 of them
    count); it says nothing of a slow curvature.

    Raises:
        ArgumentError: fewer than three of the y are above zero: two points show no scatter.
    """
    positive = y > 0
    if positive.sum() < 3:
        raise ArgumentError(
            f"{what}: {int(positive.sum())} of {y.size} sizes meet a boundary, and a fit must "
            "have at least 3."
        )
    u, v = np.log(x[positive]), np.log(y[positive])
    u = u - u.mean()
    slope = u @ v / (u @ u)
    residual = v - v.mean() - slope * u
    return Exponent(float(slope), float(np.sqrt(residual @ residual / (u.size - 2) / (u @ u))))


class Dimension(NamedTuple):
    """A box-counting dimension, with the counts to which it was fitted.

    Attributes:
        estimate: the dimension.
        error: standard error of the fit's slope; it does not include a curvature of the counts.
        sizes: sides of the boxes, shape (k,), in cells of the finest grid.
        counts: number of boxes of each size that hold a boundary, shape (k,).
    """

    estimate: float
    error: float
    sizes: np.ndarray
    counts: np.ndarray


def boundary_dimension(
    boundary: RefinedBoundary | npt.ArrayLike, *, skip: int = 0, sides: Sequence[int] | None = None
) -> Dimension:
    """Box-counting dimension D of a boundary that N ~ s^−D boxes of side s hold.

    D is a least-squares slope of log N against log s. Source: McDonald, Grebogi, Ott and Yorke,
    "Fractal basin boundaries", Physica D 17 (1985) 125, section 2. A box of a label grid holds the
    boundary if its points, including those on its faces, have more than one label. A box of a
    `RefinedBoundary` has the size of a level, and holds the boundary if a finest boundary cell is
    in it.

    Args:
        boundary: a refined boundary, or a grid of label codes of any dimension.
        skip: number of the largest sizes to leave out of the fit.
        sides: sides of the boxes on a label grid [grid spacings]. Default: powers of two, up to a
            quarter of the shortest axis. If a grid does not hold a whole number of the largest
            boxes, its far ends are left out.

    Returns:
        The dimension with its standard error, and the number of boxes at each side.

    Raises:
        ArgumentError: fewer than three sizes hold a boundary, sides are given with a refined
            boundary, a side exceeds the grid or does not divide the largest one, or an argument
            is not allowed.
    """
    check_count("skip", skip, 0)
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
    sizes = _lengths("sides", sides, shortest // 4)
    largest = int(sizes[-1])
    if largest > shortest or (largest % sizes).any():
        raise ArgumentError(
            f"sides = {sizes.tolist()} is not allowed: each must divide the largest, and that be "
            f"at most {shortest}, the shortest axis of the grid."
        )
    whole = tuple(slice((n - 1) // largest * largest + 1) for n in labels.shape)
    counts = [_mixed_boxes(labels[whole], int(side)) for side in sizes]
    return sizes, np.asarray(counts)


def _lengths(name: str, given: Sequence[int] | None, most: int) -> np.ndarray:
    """Those given, in order; otherwise powers of two up to `most`."""
    if given is None:
        return np.asarray(2 ** np.arange(max(most, 1).bit_length()))
    return np.unique([check_count(name, each) for each in given])


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


class Uncertainty(NamedTuple):
    """The fraction of ε-uncertain starts f(ε) ~ ε^α, and the boundary's dimension d − α.

    Attributes:
        exponent: α: 1 for a smooth boundary, near 0 if halving ε makes few starts certain.
        error: standard error of the fit's slope, which is that of α and of the dimension.
        dimension: d − α.
        distances: ε, shape (k,).
        fractions: f(ε), shape (k,).
    """

    exponent: float
    error: float
    dimension: float
    distances: np.ndarray
    fractions: np.ndarray


def uncertainty_exponent(
    labels: npt.ArrayLike, *, distances: Sequence[int] | None = None
) -> Uncertainty:
    """Uncertainty exponent from a grid of labels of d dimensions.

    A point is ε-uncertain if a point ε away along an axis, in either direction, has another label.
    Source: Grebogi, McDonald, Ott and Yorke, "Final state sensitivity: an obstruction to
    predictability", Phys. Lett. A 99 (1983) 415. They shift along one axis, this function along
    all axes of the grid.

    Args:
        labels: label codes on a grid of any dimension, not of a sample (see `sampled_uncertainty`).
        distances: ε [grid spacings]. Default: powers of two, up to an eighth of the shortest axis.
            Points nearer to the grid's ends than the largest distance are not counted.

    Returns:
        The exponent with its standard error, the boundary's dimension, and the fraction at each of
        the k distances.

    Raises:
        ArgumentError: fewer than three distances show a boundary, a distance leaves no point to
            count, or labels are not allowed.
    """
    grid = check_label_grid(labels)
    shortest = min(grid.shape)
    steps = _lengths("distances", distances, shortest // 8)
    margin = int(steps[-1])
    if 2 * margin >= shortest:
        raise ArgumentError(
            f"distances = {steps.tolist()} is not allowed: each must be below {shortest / 2:g}, "
            "half the shortest axis of the grid."
        )
    fractions = np.asarray([_uncertain(grid, int(k), margin).mean() for k in steps])
    return _result(steps, fractions, grid.ndim)


def _uncertain(grid: np.ndarray, step: int, margin: int) -> np.ndarray:
    inner = tuple(slice(margin, n - margin) for n in grid.shape)
    uncertain = np.zeros(grid[inner].shape, dtype=bool)
    for axis in range(grid.ndim):
        for shift in (-step, step):
            uncertain |= np.roll(grid, shift, axis)[inner] != grid[inner]
    return uncertain


def sampled_uncertainty(
    label_of: LabelOf,
    lower: npt.ArrayLike,
    upper: npt.ArrayLike,
    *,
    distances: npt.ArrayLike,
    samples: int = 1024,
    batch: int = 65536,
) -> Uncertainty:
    """Uncertainty exponent in a box of d dimensions, from labels of quasi-random starts.

    The method is that of Grebogi et al. (1983, see `uncertainty_exponent`), with starts from a
    Sobol' sequence in the box and a separate direction for each: a start is ε-uncertain if one of
    the two starts ε away along its direction has another label. This needs `samples` (1 + 2 k)
    labels.

    Args:
        label_of: function that labels points of shape (n, d); whole numbers of shape (n,).
        lower, upper: corners of the box, shape (d,).
        distances: ε, as fractions of the box's sides, shape (k,), each below 0.5.
        samples: number of starts.
        batch: maximum number of points in a call.

    Returns:
        The exponent with its standard error, the boundary's dimension, and the fraction at each of
        the k distances.

    Raises:
        ArgumentError: an argument is not allowed, or fewer than three distances have uncertain
            starts: take more samples, or larger distances.
    """
    from scipy.special import ndtri

    low, high = check_box(lower, upper)
    check_positive("distances", distances)
    parts = np.unique(check_vector("distances", distances))
    if parts[-1] >= 0.5:
        raise ArgumentError(f"distances holds {parts[-1]:g}: each must be below 0.5.")
    d = low.size
    ask = LabelOracle(label_of, batch)
    spread = spread_points(check_count("samples", samples), 2 * d)
    # Starts keep from the box's faces, so that none is asked for outside.
    centres = parts[-1] + (1.0 - 2.0 * parts[-1]) * spread[:, :d]
    ways = normalise(ndtri(spread[:, d:]))
    shifts = np.concatenate([[0.0], parts, -parts])
    starts = (centres + shifts[:, None, None] * ways).reshape(-1, d)
    labels = ask(low + starts * (high - low)).reshape(len(shifts), samples)
    other = labels[1:] != labels[0]
    return _result(parts, (other[: parts.size] | other[parts.size :]).mean(axis=1), d)


def _result(distances: np.ndarray, fractions: np.ndarray, d: int) -> Uncertainty:
    slope = fit_exponent(distances, fractions, "labels")
    return Uncertainty(slope.estimate, slope.error, d - slope.estimate, distances, fractions)
