"""The walker: two equal rigid legs on round feet, joined at the hip."""

from typing import ClassVar

import equinox as eqx

from jaxbiped._checks import ArgumentError, are_zero_together, check_pair
from jaxbiped._parameter_declaration import check_parameters, parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene._bodies import Body, Foot, Point
from jaxbiped.scene._clearance import AbstractClearance, StanceRotation
from jaxbiped.scene._mechanism import Mechanism


class Walker(eqx.Module):
    """Two equal rigid legs joined by a frictionless hinge, each ending in a circular foot.

    Source: the seed paper, section 2.1. The centre of the foot lies on the leg's axis.

    Attributes (leaves of any batch shape):
        m: mass of one leg [kg].
        J: moment of inertia of one leg about its centre of mass [kg·m²].
        l: distance from the hip to the sole [m].
        d: distance from the hip to the leg's centre of mass [m].
        r: foot radius [m].
        hip_mass: point mass at the hip [kg].

    Raises:
        ArgumentError: m or l is not above 0; J, d, r or hip_mass is below 0; l is below r; or J is
            zero (legs that are mass points) and d and hip_mass are not both above 0.
    """

    clearance: ClassVar[AbstractClearance] = StanceRotation()
    m: Parameter = parameter("leg mass", "$m$", "kg", positive=True)
    J: Parameter = parameter("leg inertia", "$J$", "kg m^2", minimum=0.0)
    l: Parameter = parameter("leg length", "$l$", "m", positive=True)
    d: Parameter = parameter("hip to mass centre", "$d$", "m", minimum=0.0)
    r: Parameter = parameter("foot radius", "$r$", "m", minimum=0.0)
    hip_mass: Parameter = parameter("hip mass", "$m_S$", "kg", minimum=0.0, default=0.0)

    def __check_init__(self) -> None:
        check_parameters(self)
        check_pair("l", self.l, "r", self.r)
        for name in ("d", "hip_mass"):
            if are_zero_together(self.J, getattr(self, name)):
                raise ArgumentError(
                    f"J = 0 is not allowed where {name} = 0: legs that are mass points need d "
                    "and hip_mass above 0."
                )

    @property
    def hip_to_foot(self) -> Scalar:
        """Distance from the hip to the centre of the foot, l − r [m]."""
        found: Scalar = by_numpy(lambda _, l, r: l - r, self.l, self.r)
        return found

    def mechanism(self) -> Mechanism:
        """The walker as a mechanism: bodies "1" and "2" on the hip, of which the second stands."""
        return Mechanism(
            root_mass=self.hip_mass,
            bodies=tuple(Body(n, mass=self.m, inertia=self.J, centre=Point(self.d)) for n in "12"),
            feet=tuple(Foot(n, centre=Point(self.hip_to_foot), radius=self.r) for n in "12"),
            mirror=(("1", "2"),),
        )

    @property
    def total_mass(self) -> Scalar:
        """Mass of both legs and the hip [kg]."""
        found: Scalar = by_numpy(lambda _, m, hip: 2.0 * m + hip, self.m, self.hip_mass)
        return found
