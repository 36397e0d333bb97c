"""Axis of a continued parameter: its range as 0 to 1, evenly or by equal factors."""

from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_positive
from jaxbiped.scene._parameter_access import (
    parameter_names,
    parameter_values,
    select_parameters,
    with_parameters,
)
from jaxbiped.scene._scene import AbstractScene

_DECADES = 100.0
"""Ratio of the ends of a range from which it is gone through by equal factors."""


class Axis(NamedTuple):
    """A parameter and the range in which it is followed.

    Attributes:
        name: of the parameter (see `parameter_names`).
        first, last: ends of the range, SI units; s is 0 at the first and 1 at the last.
        log: whether equal steps in s are equal factors.
        leaf: position of the parameter among the scene's leaves.
    """

    name: str
    first: float
    last: float
    log: bool
    leaf: int

    def value(self, s: float) -> float:
        """The parameter at s."""
        if self.log:
            return float(self.first * (self.last / self.first) ** s)
        return float(self.first + s * (self.last - self.first))

    def slope(self, s: float) -> float:
        """Its derivative with respect to s."""
        if self.log:
            return self.value(s) * float(np.log(self.last / self.first))
        return self.last - self.first

    def place(self, value: float) -> float:
        """The s of a value."""
        if self.log:
            return float(np.log(value / self.first) / np.log(self.last / self.first))
        return (value - self.first) / (self.last - self.first)


def axis_of(
    scene: AbstractScene, along: str, bounds: tuple[float, float], log: bool | None
) -> Axis:
    """The axis of a scene's parameter; raises `ArgumentError` for what is not allowed."""
    check_choice("along", along, parameter_names(scene))
    if np.shape(bounds) != (2,):
        raise ArgumentError(f"bounds = {bounds!r} is not allowed: give two numbers, (from, to).")
    for name, value in zip(("bounds[0]", "bounds[1]"), bounds, strict=True):
        check_finite(name, value)
        with_parameters(scene, {along: value})
    low, high = sorted(map(float, bounds))
    if low == high:
        raise ArgumentError(f"bounds = {bounds!r} is not allowed: the range is empty.")
    if log:
        check_positive("bounds[0]", low)
    by_factors = low > 0.0 and high >= _DECADES * low if log is None else log
    _, (leaf,) = select_parameters(scene, (along,))
    return Axis(along, low, high, by_factors, leaf)


def start_of(scene: AbstractScene, axis: Axis) -> float:
    """The scene's own value of the axis's parameter, or the nearest in its range."""
    return float(np.clip(float(parameter_values(scene)[axis.name]), axis.first, axis.last))
