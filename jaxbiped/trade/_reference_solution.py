"""Reference solution: the truth that errors are told against, and how well it is known."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

Values = Mapping[str, np.ndarray]
"""What a solve gave, by the name of the error axis."""
_AT_LEAST_ONE = ("multiplier",)
_IN_UNITS = ("state", "step_time")
"""Axes whose values are told in the scene's units already."""


class Truth(NamedTuple):
    """What counts as true.

    Attributes:
        values: by the name of the error axis.
        scales: units of the errors, likewise: 1 for states and step times, which are told in the
            scene's units; of all else the largest of the values, for multipliers 1 at least.
        floor: by how much two references disagree, in those units: no error below that is known.
    """

    values: Values
    scales: dict[str, float]
    floor: dict[str, float]

    def errors(self, found: Values) -> dict[str, float]:
        """Errors of what a solve gave; infinite where it is no number, or not as many numbers.

        Nothing is told of an axis whose truth has no numbers, as of heel strikes that never came.
        """
        return {
            name: _error(found[name], self.values[name], scale)
            for name, scale in self.scales.items()
            if name in found and np.size(self.values[name])
        }


def truth_of(values: Values, other: Values) -> Truth:
    """The truth by one reference, its floor by the other one.

    Args:
        values: arrays of the first reference, by the name of the error axis.
        other: those of the second; an axis that it lacks has no floor.
    """
    scales = {name: _scale(name, value) for name, value in values.items()}
    truth = Truth(values, scales, {})
    return truth._replace(floor=truth.errors(other))


def _scale(name: str, value: np.ndarray) -> float:
    if name in _IN_UNITS:
        return 1.0
    largest = float(np.max(np.abs(value), initial=0.0))
    return max(largest, 1.0) if name in _AT_LEAST_ONE or largest == 0.0 else largest


def _error(found: np.ndarray, true: np.ndarray, scale: float) -> float:
    if np.shape(found) != np.shape(true):
        return np.inf
    error = float(np.max(np.abs(np.subtract(found, true)), initial=0.0)) / scale
    return error if np.isfinite(error) else np.inf
