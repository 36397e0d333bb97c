"""The ground: a plane slope in gravity."""

import math

import equinox as eqx

from jaxbiped._checks import check_below, check_not_negative
from jaxbiped._types import Parameter, as_float


class Ground(eqx.Module):
    """A plane that falls at an angle towards positive x.

    Attributes (leaves of any batch shape):
        slope: angle of the slope α, downhill positive [rad].
        g: gravitational acceleration [m/s²].

    Raises:
        ArgumentError: a slope of a right angle or more, or g below 0.
    """

    slope: Parameter = eqx.field(converter=as_float)
    g: Parameter = eqx.field(converter=as_float, default=9.8)

    def __check_init__(self) -> None:
        check_below("slope", self.slope, math.pi / 2, "radians")
        check_not_negative("g", self.g, "m/s^2")
