"""Evenly spread points of cubes and directions, the same every time."""

import numpy as np


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
