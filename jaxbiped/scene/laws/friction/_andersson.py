"""Andersson's friction law."""

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_not_negative, check_positive
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._stribeck_curve import stribeck_coefficient, stribeck_switches


class Andersson(AbstractFrictionLaw):
    """F = F_N μ tanh(k V_T), opposing V_T: a Stribeck curve, regularised at rest.

    μ = mu_kinetic + (mu_static − mu_kinetic) exp(−(|V_T|/v_s)^p). For p = 1 the second
    derivative jumps at rest and for p < 1 it is without bound there; above, the law has no switch.

    Source: Andersson, Söderberg and Björklund, Tribology International 40 (2007) 580.

    Attributes (leaves of any batch shape):
        mu_static: static coefficient, which the curve starts from [–].
        mu_kinetic: kinetic coefficient, which the curve falls to [–].
        v_s: Stribeck speed, over which it falls [m/s].
        p: exponent of the fall [–].
        k: how sharply friction builds up from rest [s/m].

    Raises:
        ArgumentError: a coefficient below 0, or v_s, p or k not above 0.
    """

    mu_static: Parameter = eqx.field(converter=as_float)
    mu_kinetic: Parameter = eqx.field(converter=as_float)
    v_s: Parameter = eqx.field(converter=as_float)
    p: Parameter = eqx.field(converter=as_float)
    k: Parameter = eqx.field(converter=as_float)

    def __check_init__(self) -> None:
        check_not_negative("mu_static", self.mu_static)
        check_not_negative("mu_kinetic", self.mu_kinetic)
        check_positive("v_s", self.v_s, "m/s")
        check_positive("p", self.p)
        check_positive("k", self.k, "s/m")

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        coefficient = stribeck_coefficient(
            self.mu_static, self.mu_kinetic, self.v_s, self.p, slip_speed
        )
        return -normal_force * coefficient * jnp.tanh(self.k * slip_speed)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """Rest, where p ≤ 1."""
        return stribeck_switches(self.p, slip_speed)
