"""Power laws: exponents by least squares on logarithms."""

from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError


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
