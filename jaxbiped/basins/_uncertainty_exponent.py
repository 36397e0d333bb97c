"""The uncertainty exponent: how fast the end of a walk gets sure with the start."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped.basins._arguments import check_box, check_label_grid, check_vector, check_whole
from jaxbiped.basins._label_oracle import LabelOf, LabelOracle
from jaxbiped.basins._power_law import fit_exponent
from jaxbiped.basins._spherical_points import normalise, spread_points


class Uncertainty(NamedTuple):
    """The fraction of ε-uncertain starts f(ε) ~ ε^α, and the boundary's dimension d − α.

    Attributes:
        exponent: α: 1 for a smooth boundary, near 0 where halving ε makes few starts certain.
        error: standard error of the fit's slope, of α and of the dimension.
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

    A point is ε-uncertain if a point ε away along an axis, either way, has another label.
    Grebogi, McDonald, Ott and Yorke, "Final state sensitivity: an obstruction to predictability",
    Phys. Lett. A 99 (1983) 415, who shift along one axis; here along all of the grid's.

    Args:
        labels: label codes, any dimension.
        distances: ε [grid spacings]; unless given powers of two, up to an eighth of the shortest
            axis. Only points at least the largest from the grid's ends are counted.

    Returns:
        The exponent with its standard error, the boundary's dimension, and the fractions at each of
        the k distances.

    Raises:
        ArgumentError: no boundary at three distances, a distance that leaves no point to count,
            or labels that are not allowed.
    """
    grid = check_label_grid(labels)
    shortest = min(grid.shape)
    if distances is None:
        steps = 2 ** np.arange(max(int(np.log2(max(shortest // 8, 1))) + 1, 1))
    else:
        steps = np.unique([check_whole("distances", k, 1) for k in distances])
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
    """Uncertainty exponent in a box of d dimensions, by asking for labels.

    As Grebogi et al. (1983, see `uncertainty_exponent`), but for quasi-random starts (Sobol') in
    the box and a direction of its own for each: a start is ε-uncertain if one of the two starts
    ε away along it, either way, has another label. Asks for `samples` (1 + 2 k) labels.

    Args:
        label_of: labels, whole numbers of shape (n,), of points of shape (n, d).
        lower, upper: corners of the box, shape (d,).
        distances: ε, as parts of the box's sides, shape (k,), each below 0.5.
        samples: how many starts.
        batch: the most points in a call.

    Returns:
        The exponent with its standard error, the boundary's dimension, and the fractions at each of
        the k distances.

    Raises:
        ArgumentError: an argument that is not allowed, or uncertain starts at fewer than three
            distances: take more samples, or larger distances.
    """
    from scipy.special import ndtri

    low, high = check_box(lower, upper)
    check_positive("distances", distances)
    parts = np.unique(check_vector("distances", distances))
    if parts[-1] >= 0.5:
        raise ArgumentError(f"distances holds {parts[-1]:g}: each must be below 0.5.")
    d = low.size
    ask = LabelOracle(label_of, batch)
    spread = spread_points(check_whole("samples", samples, 1), 2 * d)
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
