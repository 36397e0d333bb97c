"""Label oracle: labels asked for in calls of bounded size, and evenly spread points to ask of."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_count, check_finite
from jaxbiped.basins._labels import Label

LabelOf = Callable[[np.ndarray], npt.ArrayLike]
"""Labels, shape (n,), of points, shape (n, d)."""


class LabelOracle:
    """Calls `label_of` with at most `batch` points at a time; keeps count of points and calls."""

    def __init__(self, label_of: LabelOf, batch: int):
        self.label_of = label_of
        self.batch = check_count("batch", batch)
        self.asked = 0
        self.calls = 0

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Labels of points of shape (n, d), shape (n,)."""
        parts = [points[k : k + self.batch] for k in range(0, len(points), self.batch)]
        return np.concatenate([np.empty(0, dtype=int), *map(self._one_call, parts)])

    def _one_call(self, points: np.ndarray) -> np.ndarray:
        labels = np.asarray(self.label_of(points))
        if labels.shape != (len(points),) or labels.dtype.kind not in "iu":
            raise ArgumentError(
                f"label_of returned {labels.dtype} of shape {labels.shape} for points of shape "
                f"{points.shape}: it must return whole numbers of shape ({len(points)},)."
            )
        if (labels == Label.PENDING).any():
            raise ArgumentError("label_of returned a pending label: each point must be labelled.")
        self.asked += len(points)
        self.calls += 1
        return labels.astype(int)


def spread_points(count: int, d: int) -> np.ndarray:
    """Sobol' points inside the unit cube, shape (count, d), none on a face or at the centre."""
    from scipy.stats import qmc

    bits = max(int(np.ceil(np.log2(max(count, 2)))), 1)
    points = qmc.Sobol(d, scramble=False).random_base2(bits)[:count]
    return points + 0.5 ** (bits + 1)


def normalise(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors along the last axis; NaN where a vector has no direction."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def spread_directions(count: int, d: int) -> np.ndarray:
    """Unit vectors: both ways along each axis, then evenly over the sphere; shape (m, d).

    m is `count`, at least 2 d; in one dimension there are two directions.
    """
    from scipy.special import ndtri

    axes = np.concatenate([np.eye(d), -np.eye(d)])
    if d == 1 or count <= 2 * d:
        return axes
    return np.concatenate([axes, normalise(ndtri(spread_points(count - 2 * d, d)))])


def check_vector(name: str, value: npt.ArrayLike) -> np.ndarray:
    """Finite numbers of shape (d,), d at least 1; raises `ArgumentError` for anything else."""
    check_finite(name, value)
    array = np.asarray(value, dtype=float)
    if array.ndim != 1 or array.size == 0:
        raise ArgumentError(
            f"{name} has shape {array.shape}: it must be (d,), one entry a dimension, d at least 1."
        )
    return array


def check_box(lower: npt.ArrayLike, upper: npt.ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """The two corners of a box, shape (d,); raises `ArgumentError` where it has no volume."""
    low, high = check_vector("lower", lower), check_vector("upper", upper)
    if low.shape != high.shape:
        raise ArgumentError(
            f"lower has shape {low.shape} and upper {high.shape}: they must be the same."
        )
    if (low >= high).any():
        k = int(np.argmax(low >= high))
        raise ArgumentError(
            f"lower[{k}] = {low[k]:g} is not below upper[{k}] = {high[k]:g}: it must be."
        )
    return low, high
