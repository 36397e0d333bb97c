"""Knots of a motion: as few times as interpolation between them allows.

Coordinates are interpolated by Hermite's cubics, all else by straight lines.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

Channels = dict[str, np.ndarray]
"""What is shown of a motion, by name; arrays of shape (n,)."""

_ROUNDS = 6
_PARTS = 4
_PASSES = 10


class Tolerances(NamedTuple):
    """How exactly channels are to be interpolated.

    Attributes:
        cubic: of each coordinate its rate's name and the error allowed, in the coordinate's unit.
        linear: of other channels the error allowed, where there are such.
        shortest: interval that is not split further [s].
    """

    cubic: Mapping[str, tuple[str, float]]
    linear: Mapping[str, float]
    shortest: float


def adaptive_knots(
    evaluate: Callable[[np.ndarray], Channels], first: np.ndarray, tolerances: Tolerances
) -> tuple[np.ndarray, Channels]:
    """Increasing times [s], shape (n,), and the channels at them.

    Intervals of the `first` times, which must see everything that happens, are quartered until
    interpolation has the channels right at the quarters; then knots are left out that their
    neighbours make up for.
    """
    t, values = first, evaluate(first)
    fresh = np.diff(t) > tolerances.shortest
    shares = np.arange(1, _PARTS) / _PARTS
    for _ in range(_ROUNDS):
        left = np.repeat(np.flatnonzero(fresh), _PARTS - 1)
        if not left.size:
            break
        at = t[left] + np.resize(shares, left.size) * (t[left + 1] - t[left])
        found = evaluate(at)
        error = _error(t, values, left, left + 1, at, found, tolerances)
        wrong = error.reshape(-1, _PARTS - 1).max(axis=1) > 1.0
        parts = np.ones(len(t) - 1, dtype=int)
        parts[fresh] = _PARTS
        split = np.zeros(len(t) - 1, dtype=bool)
        split[np.flatnonzero(fresh)[wrong]] = True
        fresh = np.repeat(split, parts)
        t = np.insert(t, left + 1, at)
        values = {name: np.insert(values[name], left + 1, found[name]) for name in values}
        fresh &= np.diff(t) > tolerances.shortest
    return _necessary_knots(t, values, tolerances)


def _necessary_knots(
    t: np.ndarray, values: Channels, tolerances: Tolerances
) -> tuple[np.ndarray, Channels]:
    for _ in range(_PASSES):
        inner = np.arange(1, len(t) - 1, 2)
        there = {name: values[name][inner] for name in values}
        error = _error(t, values, inner - 1, inner + 1, t[inner], there, tolerances)
        needless = inner[error < 0.5]
        if needless.size < 0.02 * len(t):
            break
        t = np.delete(t, needless)
        values = {name: np.delete(values[name], needless) for name in values}
    return t, values


def _error(
    t: np.ndarray,
    values: Channels,
    left: np.ndarray,
    right: np.ndarray,
    at: np.ndarray,
    there: Channels,
    tolerances: Tolerances,
) -> np.ndarray:
    """The largest error of interpolation at times between knots, in parts of what is allowed."""
    width = t[right] - t[left]
    share = (at - t[left]) / width
    worst = np.zeros(len(at))
    for name, (rate, allowed) in tolerances.cubic.items():
        start, end = values[name][left], values[name][right]
        first, last, rise = width * values[rate][left], width * values[rate][right], end - start
        square, cube = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
        drawn = start + share * (first + share * (square + share * cube))
        error = np.abs(drawn - there[name])
        worst = np.maximum(worst, error / allowed)
    for name in values.keys() & tolerances.linear.keys():
        start, end = values[name][left], values[name][right]
        error = np.abs(start + share * (end - start) - there[name])
        worst = np.maximum(worst, error / tolerances.linear[name])
    return worst
