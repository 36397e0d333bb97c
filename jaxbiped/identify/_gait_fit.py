"""Fit of a scene's parameters to measured gaits: estimates and what the data tell of them."""

import enum
from typing import NamedTuple

import numpy as np

_LOOSE = 1.0
"""Standard error, in units of a parameter's own size, from which data do not tell it."""
_NULL = 1e-9
"""Singular value, as a share of the largest, that counts as none."""


class FitEnding(enum.IntEnum):
    """How a fit ended. `str(ending)` is its name in words.

    - converged: no step lowers the sum of squares any more.
    - out of evaluations: the number allowed was used up; the estimates are the best seen.
    - no gait: the start has none under the conditions of one of the measured gaits.
    - interrupted: by the user; the estimates are the best seen.
    """

    CONVERGED = 0
    OUT_OF_EVALUATIONS = 1
    NO_GAIT = 2
    INTERRUPTED = 3

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class Information(NamedTuple):
    """What n residuals tell of k parameters, in units of the parameters' sizes.

    Attributes:
        covariance: shape (k, k); NaN in rows and columns of what is undetermined.
        undetermined: whether the data do not tell a parameter, shape (k,).
    """

    covariance: np.ndarray
    undetermined: np.ndarray


def information(slopes: np.ndarray, slope_errors: np.ndarray) -> Information:
    """From derivatives of residuals, in their standard deviations, and these derivatives' errors.

    A parameter is undetermined where its derivatives do not exceed their own errors, where others
    can make up for it, or where its standard error exceeds its size.
    """
    k = slopes.shape[1]
    told = np.linalg.norm(slopes, axis=0) > 2.0 * np.linalg.norm(slope_errors, axis=0)
    covariance = np.full((k, k), np.nan)
    while told.any():
        kept = slopes[:, told]
        scale = np.linalg.norm(kept, axis=0)
        _, singular, rows = np.linalg.svd(kept / scale)
        singular = np.append(singular, np.zeros(len(rows) - len(singular)))
        null = singular <= _NULL * singular[0]
        variances = np.where(null, 0.0, 1.0 / np.where(null, 1.0, singular) ** 2)
        found = (rows.T * variances) @ rows / np.outer(scale, scale)
        free = np.linalg.norm(rows[null], axis=0) > 1e-6
        loose = free | (np.sqrt(np.diag(found)) > _LOOSE)
        if not loose.any():
            covariance[np.ix_(told, told)] = found
            break
        # Without the loosest the others may be told.
        size = np.where(free, np.inf, np.sqrt(np.diag(found)) / _LOOSE)
        drop = free if free.any() else size == np.max(size)
        told[np.flatnonzero(told)[drop]] = False
    return Information(covariance, ~told)


class GaitFit(NamedTuple):
    """Parameters fitted to measured gaits; n numbers measured, k parameters.

    Attributes:
        ending: how the fit ended.
        estimates: by name, SI units; of what is undetermined the value that the search left it at.
        standard_errors: by name, SI units; NaN for what is undetermined.
        intervals: by name the ends of the 95 % interval; NaN for what is undetermined.
        correlation: of the estimates' errors, shape (k, k).
        undetermined: names of the parameters that the data do not tell.
        residuals: (predicted − measured) over standard deviation, shape (n,).
        evaluations: how many scenes were searched for gaits.
    """

    ending: FitEnding
    estimates: dict[str, float]
    standard_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    correlation: np.ndarray
    undetermined: tuple[str, ...]
    residuals: np.ndarray
    evaluations: int

    @property
    def chi_squared(self) -> float:
        """Sum of the squared residuals; about `freedom` where the model is right."""
        return float(np.sum(self.residuals**2))

    @property
    def freedom(self) -> int:
        """Degrees of freedom: numbers measured less parameters told by them."""
        return len(self.residuals) - len(self.estimates) + len(self.undetermined)
