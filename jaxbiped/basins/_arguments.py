"""Checks of arguments that the analyses of basins share."""

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import ArgumentError, check_finite
from jaxbiped.basins._labels import Label


def check_whole(name: str, value: npt.ArrayLike, least: int) -> int:
    """A whole number of at least `least`; raises `ArgumentError` for anything else."""
    array = np.asarray(value)
    whole = array.shape == () and array.dtype.kind in "iuf" and array == np.floor(array)
    if not whole or not least <= array < np.inf:
        raise ArgumentError(
            f"{name} = {value!r} is not allowed: it must be a whole number of at least {least}."
        )
    return int(array)


def check_confidence(value: float) -> None:
    """Raises `ArgumentError` unless the confidence lies between 0 and 1."""
    check_finite("confidence", value)
    if not (np.ndim(value) == 0 and 0.0 < value < 1.0):
        raise ArgumentError(
            f"confidence = {value} is not allowed: it must be one number above 0 and below 1."
        )


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


def check_label_grid(labels: npt.ArrayLike) -> np.ndarray:
    """Label codes on a grid of one or more dimensions, none of them pending.

    Raises:
        ArgumentError: no entry, no axis, codes that are not whole numbers, or a pending one.
    """
    grid = np.asarray(labels)
    if grid.ndim == 0 or grid.size == 0:
        raise ArgumentError(
            f"labels has shape {grid.shape}: it must be a grid with at least one entry."
        )
    if grid.dtype.kind not in "iu":
        raise ArgumentError(f"labels has dtype {grid.dtype}: it must be whole numbers, the codes.")
    pending = int((grid == Label.PENDING).sum())
    if pending:
        raise ArgumentError(
            f"labels has {pending} pending entries of {grid.size}: they must all be labelled."
        )
    return grid


def check_known(labels: np.ndarray) -> None:
    """Raises `ArgumentError` for whole numbers that are no code of `Label`."""
    unknown = sorted(set(np.unique(labels).tolist()) - set(map(int, Label)))
    if unknown:
        raise ArgumentError(f"labels holds {unknown[0]}: it must hold names or codes of Label.")
