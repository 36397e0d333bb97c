"""Friction by bristles: Dahl's law and LuGre."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._checks import check_positive
from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractBristleLaw
from jaxbiped.scene.laws.friction._stribeck import BengisuAkay

_DAHL_GIVE = 4e-4
"""How far the bristles of the law like the seed's bend before they slip [m]."""


class Dahl(AbstractBristleLaw):
    """Ḟ = σ0 V_T (1 − (F/F_C) sgn V_T), here with F = b F_N and F_C = mu F_N.

    The bristles bend before they slip, and forget exponentially over a slip of mu/sigma_0. There is
    no Stribeck peak and no viscous part. The stress–strain curve has Dahl's exponent one.

    Source: Dahl, "Solid friction damping of mechanical vibrations", AIAA J. 14 (1976).

    Attributes (leaves of any batch shape):
        mu: coefficient of friction [–].
        sigma_0: stiffness of the bristles per newton of load [1/m].
        engaging_load: normal force at which bristles are half in contact [N].
        relaxation: rate at which bristles straighten out of contact [1/s].

    Raises:
        ArgumentError: relaxation is below 0, or another parameter is not above 0.
    """

    name: ClassVar[str] = "dahl"
    mu: Parameter = parameter("friction coefficient", r"$\mu$", positive=True)
    sigma_0: Parameter = parameter("bristle stiffness", r"$\sigma_0$", "1/m", positive=True)
    engaging_load: Parameter = parameter("engaging load", "$F_e$", "N", positive=True, default=1.0)
    relaxation: Parameter = parameter(
        "bristle relaxation", r"$\kappa$", "1/s", minimum=0.0, default=50.0
    )

    def engagement(self) -> tuple[Scalar, Scalar]:
        return self.engaging_load, self.relaxation

    def rate(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        return self.sigma_0 * (slip_speed - jnp.abs(slip_speed) * bristle / self.mu)

    def coefficient(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        return bristle

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The kinetic coefficient, with bristles that bend by mu/sigma_0 = 4e-4 m before they slip.

        The bristles are undamped and ring; the stiffer they are, the faster and longer they ring.
        With these soft bristles, the seed's walk takes nearly five times as many steps as with the
        seed's law, and `find_gait` finds its gait. Below about 2e-4 m, `find_gait` finds it only
        with accuracy="tight".
        """
        stiffness = by_numpy(lambda _, mu: mu / _DAHL_GIVE, seed.mu_kinetic)
        return cls(mu=seed.mu_kinetic, sigma_0=stiffness)


_LUGRE_GIVE = 1e-5
"""How far the bristles of the law like the seed's bend before they slip [m]."""
_MASS_PER_LOAD = 0.05
"""What they hold in place for each newton of load [kg/N]: 1 kg under 20 N."""


class LuGre(AbstractBristleLaw):
    """Bristles with damping and a Stribeck peak, with every part proportional to the load.

    With the deflection z = b/σ0, g(V) = mu_kinetic + (mu_static − mu_kinetic) exp(−(V/v_s)²):

    - ż = V_T − σ0 |V_T| z / g(V_T)
    - F = F_N (σ0 z + σ1 ż + σ2 V_T)

    Source: Canudas de Wit, Olsson, Åström, Lischinsky, IEEE Trans. Automatic Control 40 (1995);
    proportional to the load after Canudas de Wit and Tsiotras (1999). The original has forces in
    place of coefficients, so its bristles would be infinitely stiff where the load vanishes.

    Attributes (leaves of any batch shape):
        mu_static: coefficient of slow steady slip [–].
        mu_kinetic: coefficient of fast slip [–].
        v_s: Stribeck speed [m/s].
        sigma_0: stiffness of the bristles per newton of load [1/m].
        sigma_1: damping of the bristles per newton of load [s/m].
        sigma_2: viscous friction per newton of load [s/m].
        engaging_load: normal force at which bristles are half in contact [N].
        relaxation: rate at which bristles straighten out of contact [1/s].

    Raises:
        ArgumentError: a coefficient, v_s, sigma_0 or engaging_load is not above 0; or sigma_1,
            sigma_2 or relaxation is below 0.
    """

    name: ClassVar[str] = "lugre"
    mu_static: Parameter = parameter("static friction", r"$\mu_0$", positive=True)
    mu_kinetic: Parameter = parameter("kinetic friction", r"$\mu$", positive=True)
    v_s: Parameter = parameter("Stribeck speed", "$v_s$", "m/s", positive=True)
    sigma_0: Parameter = parameter("bristle stiffness", r"$\sigma_0$", "1/m", positive=True)
    sigma_1: Parameter = parameter("bristle damping", r"$\sigma_1$", "s/m", minimum=0.0)
    sigma_2: Parameter = parameter(
        "viscous friction", r"$\sigma_2$", "s/m", minimum=0.0, default=0.0
    )
    engaging_load: Parameter = parameter("engaging load", "$F_e$", "N", positive=True, default=1.0)
    relaxation: Parameter = parameter(
        "bristle relaxation", r"$\kappa$", "1/s", minimum=0.0, default=50.0
    )

    def engagement(self) -> tuple[Scalar, Scalar]:
        return self.engaging_load, self.relaxation

    def rate(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        return self.sigma_0 * self._deflection_rate(slip_speed, bristle)

    def coefficient(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        damping = self.sigma_1 * self._deflection_rate(slip_speed, bristle)
        return bristle + damping + self.sigma_2 * slip_speed

    def _deflection_rate(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        u = slip_speed / self.v_s
        steady = self.mu_kinetic + (self.mu_static - self.mu_kinetic) * jnp.exp(-u * u)
        return slip_speed - jnp.abs(slip_speed) * bristle / steady

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """Both coefficients and the fall over 1/xi, with bristles that bend by 1e-5 m before slip.

        Their damping is critical for 1 kg that carries 20 N, and sigma_2 = 0.
        """
        check_positive("xi", seed.xi, "s/m")
        sigma_0: Scalar = by_numpy(lambda _, mu: mu / _LUGRE_GIVE, seed.mu_static)
        return cls(
            mu_static=seed.mu_static,
            mu_kinetic=seed.mu_kinetic,
            v_s=by_numpy(lambda _, xi: 1.0 / xi, seed.xi),
            sigma_0=sigma_0,
            sigma_1=by_numpy(
                lambda numpy, sigma_0: 2.0 * numpy.sqrt(sigma_0 * _MASS_PER_LOAD), sigma_0
            ),
        )
