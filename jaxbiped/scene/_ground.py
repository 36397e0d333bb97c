"""The ground: a plane slope in gravity."""

import math

import equinox as eqx

from jaxbiped._parameter import check_parameters, parameter
from jaxbiped._types import Parameter


class Ground(eqx.Module):
    """A plane that falls at an angle towards positive x.

    Attributes (leaves of any batch shape):
        slope: angle of the slope α, downhill positive [rad].
        g: gravitational acceleration [m/s²].

    Raises:
        ArgumentError: a slope of a right angle or more, or g below 0.
    """

    slope: Parameter = parameter("slope", r"$\alpha$", "rad", size_below=math.pi / 2)
    g: Parameter = parameter("gravity", "$g$", "m/s^2", minimum=0.0, default=9.8)

    def __check_init__(self) -> None:
        check_parameters(self)
