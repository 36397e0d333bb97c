"""Dahl's law of friction."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws.bristles._bristle_law import AbstractBristleLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay

_GIVE = 4e-4
"""How far the bristles of the law like the seed's bend before they slip [m]."""


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
        """The kinetic coefficient, on bristles that give by 4e-4 m, mu/sigma_0, before they slip.

        They have no damping and ring, faster and longer the stiffer they are: so soft, the seed's
        walk takes nearly five times as many steps as with the seed's law, and `find_gait` finds
        its gait. With less than about 2e-4 m it does so by accuracy="tight" only.
        """
        stiffness = by_numpy(lambda _, mu: mu / _GIVE, seed.mu_kinetic)
        return cls(mu=seed.mu_kinetic, sigma_0=stiffness)
