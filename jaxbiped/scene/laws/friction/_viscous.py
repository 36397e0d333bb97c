"""Viscous friction."""

import equinox as eqx

from jaxbiped._checks import check_not_negative
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw


class Viscous(AbstractFrictionLaw):
    """F = k F_N V_T, opposing V_T. Smooth everywhere and without bound.

    Proportional to the load, unlike the viscous term of a lubricated joint, so that it fades with
    contact: a foot that carries nothing feels no friction.

    Attributes (leaves of any batch shape):
        k: friction per load and slip speed [s/m].

    Raises:
        ArgumentError: k below 0.
    """

    k: Parameter = eqx.field(converter=as_float)

    def __check_init__(self) -> None:
        check_not_negative("k", self.k, "s/m")

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return -self.k * normal_force * slip_speed

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()
