"""Dahl's law of friction."""

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_not_negative, check_positive
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws.bristles._bristle_law import AbstractBristleLaw


class Dahl(AbstractBristleLaw):
    """Ḟ = σ0 V_T (1 − (F/F_C) sgn V_T), here with F = b F_N and F_C = mu F_N.

    It bends before it slips and forgets exponentially over a slip of mu/sigma_0. No Stribeck peak,
    no viscous part. Its stress–strain curve is that of Dahl's exponent one.

    Source: Dahl, "Solid friction damping of mechanical vibrations", AIAA J. 14 (1976).

    Attributes (leaves of any batch shape):
        mu: coefficient of friction [–].
        sigma_0: stiffness of the bristles for each newton of load [1/m].
        engaging_load: normal force at which bristles are half in contact [N].
        relaxation: rate at which they straighten out of contact [1/s].

    Raises:
        ArgumentError: a parameter not above 0, or relaxation below 0.
    """

    mu: Parameter = eqx.field(converter=as_float)
    sigma_0: Parameter = eqx.field(converter=as_float)
    engaging_load: Parameter = eqx.field(converter=as_float, default=1.0)
    relaxation: Parameter = eqx.field(converter=as_float, default=50.0)

    def __check_init__(self) -> None:
        check_positive("mu", self.mu)
        check_positive("sigma_0", self.sigma_0, "1/m")
        check_positive("engaging_load", self.engaging_load, "N")
        check_not_negative("relaxation", self.relaxation, "1/s")

    def engagement(self) -> tuple[Scalar, Scalar]:
        return self.engaging_load, self.relaxation

    def rate(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        return self.sigma_0 * (slip_speed - jnp.abs(slip_speed) * bristle / self.mu)

    def coefficient(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        return bristle
