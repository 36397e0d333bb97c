"""Statistics of labels: the fraction of the starts with each, and the entropy of basins."""

import dataclasses
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jaxbiped._checks import (
    ArgumentError,
    check_at_least,
    check_choice,
    check_count,
    check_finite,
    check_not_negative,
)
from jaxbiped.basins._labels import (
    Label,
    check_known,
    check_label_grid,
    check_no_dataset,
    endings_of,
    word_of_code,
)

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
    check_no_dataset(labels)
    names = _names(np.asarray(labels), endings_of(labels))
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


def _names(labels: np.ndarray, endings: tuple[str, ...] | None) -> np.ndarray:
    if labels.size == 0:
        raise ArgumentError(f"labels has shape {labels.shape}: it must have at least one entry.")
    if labels.dtype.kind not in "iu":
        return labels.astype(str).ravel()
    check_known(labels, endings)
    codes, place = np.unique(labels.ravel(), return_inverse=True)
    return np.asarray([word_of_code(code, endings) for code in codes])[place]


def _check_confidence(value: float) -> None:
    """Raises `ArgumentError` unless the confidence lies between 0 and 1."""
    check_finite("confidence", value)
    if not (np.ndim(value) == 0 and 0.0 < value < 1.0):
        raise ArgumentError(
            f"confidence = {value} is not allowed: it must be one number above 0 and below 1."
        )


class Entropy(NamedTuple):
    """Entropies in nats, over boxes of a label grid.

    Attributes:
        basin: S_b, mean entropy of all boxes.
        boundary: S_bb, mean entropy of the boxes with more than one label; NaN without any.
        boundary_error: standard error of that mean; NaN with fewer than two such boxes.
        box: side of a box [grid points].
        boxes: number of boxes.
        boundary_boxes: number of boxes with more than one label.
        fractal: whether S_bb > log 2. A smooth boundary separates only two basins in all but a few
            boxes, so its S_bb cannot exceed log 2. If S_bb > log 2, the boundary is fractal;
            otherwise, nothing is known.
    """

    basin: float
    boundary: float
    boundary_error: float
    box: int
    boxes: int
    boundary_boxes: int
    fractal: bool


def entropy(labels: npt.ArrayLike, *, box: int = 5) -> Entropy:
    """Basin entropy and boundary basin entropy of a grid of labels, of any dimension.

    S_i = −Σ_j p_ij log p_ij, where p_ij is the fraction of box i with label j. Source, also of the
    log 2 criterion: Daza, Wagemakers, Georgeot, Guéry-Odelin and Sanjuán, "Basin entropy: a new
    tool to analyze uncertainty in dynamical systems", Sci. Rep. 6 (2016) 31416, equations 2 to 4.
    The values depend on the size of a box: compare only values of one box size and resolution.

    Args:
        labels: label codes on a grid, not of a sample. Points at the far ends that do not fill a
            whole box are left out.
        box: side of a box [grid points], at least 2; the source uses 5.

    Returns:
        The two entropies [nats], and whether the boundary is fractal by the log 2 criterion.

    Raises:
        ArgumentError: labels are not allowed, or the box is larger than the grid.

    Examples:
        >>> import jaxbiped as jb
        >>> import numpy as np
        >>> halves = np.repeat([0, 1], 50)[:, None] * np.ones(100, dtype=int)
        >>> round(jb.basins.entropy(halves).basin, 6)
        0.0
    """
    grid = check_label_grid(labels)
    side = check_count("box", box, 2)
    if side > min(grid.shape):
        raise ArgumentError(
            f"box = {side} is not allowed: it must be at most {min(grid.shape)}, "
            "the shortest axis of the grid."
        )
    entropies = np.zeros([n // side for n in grid.shape])
    for label in np.unique(grid):
        p = _box_means(grid == label, side)
        entropies -= p * np.log(p, where=p > 0, out=np.zeros_like(p))
    mixed = entropies[entropies > 0]
    boundary = float(mixed.mean()) if mixed.size else np.nan
    return Entropy(
        basin=float(entropies.mean()),
        boundary=boundary,
        boundary_error=float(mixed.std(ddof=1) / np.sqrt(mixed.size)) if mixed.size > 1 else np.nan,
        box=side,
        boxes=entropies.size,
        boundary_boxes=mixed.size,
        fractal=bool(boundary > np.log(2.0)),
    )


def _box_means(values: np.ndarray, side: int) -> np.ndarray:
    counts = [n // side for n in values.shape]
    whole = values[tuple(slice(n * side) for n in counts)]
    split = [length for n in counts for length in (n, side)]
    return whole.reshape(split).mean(axis=tuple(range(1, 2 * len(counts), 2)))
