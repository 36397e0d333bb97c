"""Fractions of the starts with each label, and their confidence intervals."""

import dataclasses

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import (
    ArgumentError,
    check_at_least,
    check_choice,
    check_finite,
    check_not_negative,
)
from jaxbiped.basins._labels import Label, check_known

_RARE = 3
"""Counts up to which an interval's end is that of Poisson's distribution."""


@dataclasses.dataclass(frozen=True)
class Fraction:
    """A fraction of the starts with its confidence interval.

    Attributes:
        estimate: count divided by the number of counted starts [–].
        low, high: ends of the confidence interval [–].
        count: number of starts with the label.
    """

    estimate: float
    low: float
    high: float
    count: int


class Fractions(dict[str, Fraction]):
    """Fractions by the names of labels, the most frequent first.

    It holds the labels that occur. For any other label, it returns the fraction 0 with its
    interval; names that are not labels are refused.
    """

    def __init__(self, found: dict[str, Fraction], absent: Fraction) -> None:
        super().__init__(found)
        self._absent = absent

    def __missing__(self, name: str) -> Fraction:
        check_choice("label", name, {*self, *map(str, Label)})
        return self._absent


def wilson_interval(
    count: npt.ArrayLike, total: npt.ArrayLike, *, confidence: float = 0.95
) -> tuple[np.ndarray, np.ndarray]:
    """Wilson's score interval of a proportion; from 0 to 1 where nothing was counted.

    Wilson, "Probable inference, the law of succession, and statistical inference", J. Am. Stat.
    Assoc. 22 (1927) 209. Next to 0 and 1 its 95 % would cover as little as 83.8 %. Lower ends of
    counts from 1 to 3, and upper ends of as many failures, are therefore those of Poisson's
    distribution, as Brown, Cai and DasGupta, "Interval estimation for a binomial proportion",
    Stat. Sci. 16 (2001) 101, modify it. It holds for starts drawn independently (the
    method "uniform" of `jaxbiped.starts.sample`); for a regular grid or a Sobol sequence, whose
    starts are spread more evenly than that, it is usually too wide.

    Args:
        count: how many have the property, any shape.
        total: of how many, a shape that broadcasts with it.
        confidence: probability that the interval covers the proportion.

    Returns:
        The lower and the upper ends, of the broadcast shape.

    Raises:
        ArgumentError: a count below 0 or above its total, shapes that do not broadcast, or a
            confidence not between 0 and 1.

    Examples:
        >>> import jaxbiped as jb
        >>> low, high = jb.basins.wilson_interval(30, 100)
        >>> round(float(low), 4), round(float(high), 4)
        (0.2189, 0.3958)
    """
    from scipy.special import gammaincinv, ndtri

    _check_confidence(confidence)
    check_not_negative("count", count)
    check_not_negative("total", total)
    k, n = np.asarray(count, dtype=float), np.asarray(total, dtype=float)
    try:
        k, n = np.broadcast_arrays(k, n)
    except ValueError:
        raise ArgumentError(
            f"count has shape {k.shape} and total {n.shape}: they must broadcast."
        ) from None
    check_at_least("total", n, "count", k)

    z = ndtri(0.5 + 0.5 * confidence)
    # Multiplied through by n, so that nothing counted is no exception.
    failures = np.divide(k * (n - k), n, out=np.zeros_like(n), where=n > 0)
    half = z * np.sqrt(failures + 0.25 * z**2) / (n + z**2)
    centre = (k + 0.5 * z**2) / (n + z**2)

    def lowest(wilson: np.ndarray, count: np.ndarray) -> np.ndarray:
        poisson = gammaincinv(np.maximum(count, 1.0), 1.0 - confidence) / np.maximum(n, 1.0)
        rare = np.where(count <= _RARE, np.minimum(wilson, poisson), wilson)
        return np.where(count == 0, 0.0, rare)

    return lowest(centre - half, k), 1.0 - lowest(1.0 - centre - half, n - k)


def fractions(
    labels: npt.ArrayLike, *, doubt: npt.ArrayLike | None = None, confidence: float = 0.95
) -> Fractions:
    """The fraction of the starts with each label, the most frequent first.

    Args:
        labels: names (`label_names`) or codes of `Label`, any shape. Pending labels are not
            counted; if all are pending, the result is empty.
        doubt: whether each label remains in doubt (booleans), of the labels' shape. The lower end
            of each interval then counts none of these labels, and the upper end all of them.
        confidence: confidence level of the intervals, see `wilson_interval`.

    Returns:
        A `Fraction` by the name of each label that occurs; see `Fractions` for others.

    Raises:
        ArgumentError: there is no label, a code is unknown, `doubt` has another shape, or the
            confidence is not between 0 and 1.

    Examples:
        >>> import jaxbiped as jb
        >>> found = jb.basins.fractions([0, 0, 0, 1])
        >>> {name: (float(each.estimate), each.count) for name, each in found.items()}
        {'walking': (0.75, 3), 'fell forward': (0.25, 1)}
    """
    _check_confidence(confidence)
    if hasattr(labels, "data_vars"):
        raise ArgumentError("labels is a whole dataset, which is not allowed: give its `label`.")
    names = _names(np.asarray(labels))
    unsure = np.zeros(np.shape(labels), bool) if doubt is None else np.asarray(doubt, dtype=bool)
    if unsure.shape != np.shape(labels):
        raise ArgumentError(
            f"doubt has shape {unsure.shape}: it must be that of labels, {np.shape(labels)}."
        )
    known = names != str(Label.PENDING)
    distinct, place, counts = np.unique(names[known], return_inverse=True, return_counts=True)
    total = int(counts.sum())
    own = np.bincount(place, weights=unsure.ravel()[known], minlength=len(distinct)).astype(int)
    low, _ = wilson_interval(counts - own, total, confidence=confidence)
    _, high = wilson_interval(counts + own.sum() - own, total, confidence=confidence)
    order = np.argsort(-counts, kind="stable")
    found = {
        str(distinct[k]): Fraction(count / total, float(low[k]), float(high[k]), count)
        for k, count in zip(order, counts[order].tolist(), strict=True)
    }
    _, most = wilson_interval(own.sum(), total, confidence=confidence)
    return Fractions(found, Fraction(0.0 if total else np.nan, 0.0, float(most), 0))


def _names(labels: np.ndarray) -> np.ndarray:
    if labels.size == 0:
        raise ArgumentError(f"labels has shape {labels.shape}: it must have at least one entry.")
    if labels.dtype.kind not in "iu":
        return labels.astype(str).ravel()
    check_known(labels)
    codes, place = np.unique(labels.ravel(), return_inverse=True)
    return np.asarray([str(Label(code)) for code in codes])[place]


def _check_confidence(value: float) -> None:
    """Raises `ArgumentError` unless the confidence lies between 0 and 1."""
    check_finite("confidence", value)
    if not (np.ndim(value) == 0 and 0.0 < value < 1.0):
        raise ArgumentError(
            f"confidence = {value} is not allowed: it must be one number above 0 and below 1."
        )
