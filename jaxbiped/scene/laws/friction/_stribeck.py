"""Friction with an exponential Stribeck curve and a viscous part."""

from typing import ClassVar, Self

from jaxbiped._checks import check_positive
from jaxbiped._jax_versions import tanh
from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay
from jaxbiped.scene.laws.friction._stribeck_curve import stribeck_coefficient, stribeck_switches


class Stribeck(AbstractFrictionLaw):
    """Friction that falls from static to kinetic and rises again with the speed of slip.

    F = F_N (μ tanh(V_T/v_d) + k_v V_T), opposing V_T, with
    μ = mu_kinetic + (mu_static − mu_kinetic) exp(−(|V_T|/v_s)^p).

    The tanh regularises rest. Where v_d is well below v_s (p = 2) the peak lies at a few v_d and
    reaches all but mu_static. The viscous part is proportional to the load, so that it fades with
    contact. For p = 1 the second derivative jumps at rest and for p < 1 it is without bound there;
    above, the law has no switch.

    Source: Bo and Pavelescu, Wear 82 (1982) 277; Armstrong-Hélouvry, Dupont and Canudas de Wit,
    Automatica 30 (1994) 1083.

    Attributes (leaves of any batch shape):
        mu_static: static coefficient, which the curve starts from [–].
        mu_kinetic: kinetic coefficient, which the curve falls to [–].
        v_s: Stribeck speed, over which it falls [m/s].
        p: exponent of the fall, usually from 0.5 to 2 [–].
        k_v: viscous friction per load and slip speed [s/m].
        v_d: slip speed over which friction builds up from rest [m/s].

    Raises:
        ArgumentError: a coefficient or k_v below 0, or v_s, p or v_d not above 0.
    """

    name: ClassVar[str] = "stribeck"
    builds_up_over: ClassVar[str | None] = "v_d"
    mu_static: Parameter = parameter("static friction", r"$\mu_0$", minimum=0.0)
    mu_kinetic: Parameter = parameter("kinetic friction", r"$\mu$", minimum=0.0)
    v_s: Parameter = parameter("Stribeck speed", "$v_s$", "m/s", positive=True)
    p: Parameter = parameter("exponent of the fall", "$p$", positive=True)
    k_v: Parameter = parameter("viscous friction", "$k_v$", "s/m", minimum=0.0)
    v_d: Parameter = parameter("build-up speed", "$v_d$", "m/s", positive=True)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        coefficient = stribeck_coefficient(
            self.mu_static, self.mu_kinetic, self.v_s, self.p, slip_speed
        )
        dry = coefficient * tanh(slip_speed / self.v_d)
        return -normal_force * (dry + self.k_v * slip_speed)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """Rest, where p ≤ 1."""
        return stribeck_switches(self.p, slip_speed)

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """Both coefficients, the slope 2 mu/v0 at rest (v_d = v0/2), the fall over 1/xi (p = 1)."""
        check_positive("xi", seed.xi, "s/m")
        return cls(
            mu_static=seed.mu_static,
            mu_kinetic=seed.mu_kinetic,
            v_s=by_numpy(lambda _, xi: 1.0 / xi, seed.xi),
            p=1.0,
            k_v=0.0,
            v_d=by_numpy(lambda _, v0: 0.5 * v0, seed.v0),
        )
