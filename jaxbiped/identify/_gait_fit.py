"""Fit of a scene's parameters to measured gaits: what it found, and what residuals tell."""

import dataclasses
import math
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from jaxbiped._ending import NamedCode
from jaxbiped._quantity import Quantity
from jaxbiped._tables import Entry, Tabular, variables_of

if TYPE_CHECKING:
    import xarray

LOOSE = 1.0
"""Standard error, in units of a parameter's own size, from which data do not tell it."""
_NULL = 1e-9
"""Singular value, as a share of the largest, that counts as none."""


class FitEnding(NamedCode):
    """How a fit ended. `str(ending)` is its name in words.

    - converged: no step reduces the sum of squares any further.
    - out of evaluations: the allowed number was used up; the estimates are the best so far.
    - no gait: the start has no gait under the conditions of one of the measured gaits.
    - interrupted: by the user; the estimates are the best so far.
    """

    CONVERGED = 0
    OUT_OF_EVALUATIONS = 1
    NO_GAIT = 2
    INTERRUPTED = 3


class Information(NamedTuple):
    """What n residuals tell of k parameters jointly, in units of the parameters' sizes.

    Attributes:
        covariance: shape (k, k), of each parameter while all others are free; NaN in rows and
            columns of what is undetermined.
        undetermined: whether the data do not tell a parameter, shape (k,).
        resolved: whether a parameter's derivatives exceed their own errors, shape (k,).
        distinct: whether they do, and no other parameters can make up for it, shape (k,).
        rank: how many combinations of parameters are told.
    """

    covariance: np.ndarray
    undetermined: np.ndarray
    resolved: np.ndarray
    distinct: np.ndarray
    rank: int


def information(slopes: np.ndarray, slope_errors: np.ndarray) -> Information:
    """From derivatives of residuals, in their standard deviations, and these derivatives' errors.

    A parameter is undetermined where its derivatives do not exceed their own errors, where others
    can make up for it as far as these errors show, or where its standard error in the joint fit
    exceeds its size.
    """
    k = slopes.shape[1]
    sizes, sizes_of_errors = (np.linalg.norm(each, axis=0) for each in (slopes, slope_errors))
    resolved = sizes > 2.0 * sizes_of_errors
    covariance, undetermined = np.full((k, k), np.nan), np.ones(k, bool)
    if not resolved.any():
        return Information(covariance, undetermined, resolved, resolved, 0)
    scale = sizes[resolved]
    _, singular, rows = np.linalg.svd(slopes[:, resolved] / scale)
    singular = np.append(singular, np.zeros(len(rows) - len(singular)))
    noise = np.linalg.norm((slope_errors[:, resolved] / scale) @ np.abs(rows.T), axis=0)
    null = singular <= np.maximum(_NULL * singular[0], 2.0 * noise)
    variances = np.where(null, 0.0, 1.0 / np.where(null, 1.0, singular) ** 2)
    found = (rows.T * variances) @ rows / np.outer(scale, scale)
    # Errors of the derivatives turn the directions that nothing is told of, too.
    turned = 1e-6 + 2.0 * float(np.max(noise)) / np.min(singular[~null], initial=np.inf)
    free = np.linalg.norm(rows[null], axis=0) > turned
    loose = free | (np.sqrt(np.diag(found)) > LOOSE)
    undetermined[resolved], distinct = loose, resolved.copy()
    distinct[resolved] = ~free
    kept = ~undetermined
    covariance[np.ix_(kept, kept)] = found[np.ix_(~loose, ~loose)]
    return Information(covariance, undetermined, resolved, distinct, int(np.sum(~null)))


@dataclasses.dataclass(frozen=True)
class GaitFit(Tabular):
    """Parameters fitted to measured gaits; n numbers measured, k parameters.

    Attributes:
        ending: how the fit ended.
        estimates: estimates by name, SI units; for an undetermined parameter, the last value of the
            search.
        standard_errors: standard errors of the joint fit by name, SI units; NaN for parameters that
            are undetermined, one-sided or at a bound, or whose error exceeds their size.
        intervals: ends of the 95 % interval by name; farther out, no values of the other
            parameters, within their bounds, compensate for this one. An end that the data do not
            tell is the bound, 0 or infinite, and the parameter is one-sided. NaN for parameters
            that are undetermined or at a bound.
        correlation: of the estimates' errors, shape (k, k).
        undetermined: names of the parameters that the data limit on neither side.
        at_bounds: names of the parameters that are held by a bound, because the data favour a value
            beyond it.
        residuals: (predicted − measured) over standard deviation, shape (n,).
        freedom: degrees of freedom: the number of measured values minus the number of parameter
            combinations and clocks of angles that they determine.
        evaluations: number of scenes that were searched for gaits.
        units: SI units of the parameters by name.
        one_sided: names of the parameters that the data limit on one side only.
    """

    rows: ClassVar[str] = "parameter"
    ending: FitEnding
    estimates: dict[str, float]
    standard_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    correlation: np.ndarray
    undetermined: tuple[str, ...]
    at_bounds: tuple[str, ...]
    residuals: np.ndarray
    freedom: int
    evaluations: int
    units: dict[str, str]
    one_sided: tuple[str, ...] = ()

    def __repr__(self) -> str:
        pairs = zip(self.estimates.items(), self.standard_errors.values(), strict=True)
        estimates = ", ".join(f"{name}={value:.6g} ± {bar:.2g}" for (name, value), bar in pairs)
        words = {"undetermined": self.undetermined, "at bounds": self.at_bounds}
        words["limited on one side"] = self.one_sided
        held = (f", {said}: {', '.join(names)}" for said, names in words.items() if names)
        return (
            f"GaitFit({self.ending}, {estimates}, chi squared {self.chi_squared:.3g} at "
            f"{self.freedom} degrees of freedom{''.join(held)}, {self.evaluations} scenes)"
        )

    @property
    def chi_squared(self) -> float:
        """Sum of the squared residuals; about `freedom` if the model is right."""
        return float(np.sum(self.residuals**2))

    @property
    def p_value(self) -> float:
        """Probability of a chi squared at least as large if the model is right; NaN for none."""
        from scipy.stats import chi2

        return float(chi2.sf(self.chi_squared, self.freedom)) if self.freedom > 0 else math.nan

    def to_dataset(self) -> "xarray.Dataset":
        """The fit as a labelled dataset, for `to_netcdf` or `to_zarr`.

        Returns:
            Along `parameter` the estimates with their standard errors, the ends of the 95 %
            intervals, units, and whether a parameter is undetermined, one-sided or at a bound; the
            correlation along `parameter` and `other`; residuals along `measurement`.
        """
        import xarray

        names, (low, high) = list(self.estimates), zip(*self.intervals.values(), strict=True)
        yes = {0: "no", 1: "yes"}

        def column(values: object, words: str, **more: object) -> Entry:
            return Entry(("parameter",), values, Quantity(words, unit="SI"), **more)  # type: ignore[arg-type]

        def among(chosen: tuple[str, ...], words: str) -> Entry:
            return column(np.isin(names, chosen).astype(np.int8), words, flags=yes)

        bars = list(self.standard_errors.values())
        entries = {
            "estimate": column(list(self.estimates.values()), "estimate", errors=bars),
            "low": column(low, "lower end of 95 %"),
            "high": column(high, "upper end of 95 %"),
            "undetermined": among(self.undetermined, "undetermined"),
            "one_sided": among(self.one_sided, "limited on one side"),
            "at_bound": among(self.at_bounds, "at a bound"),
            "correlation": Entry(("parameter", "other"), self.correlation, Quantity("correlation")),
            "residual": Entry(("measurement",), self.residuals, Quantity("residual")),
        }
        coordinates = {
            "parameter": np.array(names, object),
            "unit": ("parameter", np.array([self.units[name] for name in names], object)),
            "other": np.array(names, object),
        }
        attributes = {
            "ending": str(self.ending),
            "chi_squared": self.chi_squared,
            "freedom": self.freedom,
            "p_value": self.p_value,
            "evaluations": self.evaluations,
        }
        return xarray.Dataset(variables_of(entries), coordinates, attributes)
