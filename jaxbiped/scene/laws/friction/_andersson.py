"""Andersson's friction law."""

from typing import ClassVar, Self

from jaxbiped._checks import check_positive
from jaxbiped._jax_versions import tanh
from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay
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

    name: ClassVar[str] = "andersson"
    mu_static: Parameter = parameter("static friction", r"$\mu_0$", minimum=0.0)
    mu_kinetic: Parameter = parameter("kinetic friction", r"$\mu$", minimum=0.0)
    v_s: Parameter = parameter("Stribeck speed", "$v_s$", "m/s", positive=True)
    p: Parameter = parameter("exponent of the fall", "$p$", positive=True)
    k: Parameter = parameter("friction per slip", "$k$", "s/m", positive=True)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        coefficient = stribeck_coefficient(
            self.mu_static, self.mu_kinetic, self.v_s, self.p, slip_speed
        )
        return -normal_force * coefficient * tanh(self.k * slip_speed)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """Rest, where p ≤ 1."""
        return stribeck_switches(self.p, slip_speed)

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """Both coefficients, the slope 2 mu/v0 at rest (k = 2/v0), the fall over 1/xi (p = 1)."""
        check_positive("xi", seed.xi, "s/m")
        return cls(
            mu_static=seed.mu_static,
            mu_kinetic=seed.mu_kinetic,
            v_s=by_numpy(lambda _, xi: 1.0 / xi, seed.xi),
            p=1.0,
            k=by_numpy(lambda _, v0: 2.0 / v0, seed.v0),
        )
