"""Viscous friction."""

from typing import ClassVar, Self

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay


class Viscous(AbstractFrictionLaw):
    """F = k F_N V_T, opposing V_T. Smooth everywhere and without bound.

    Proportional to the load, unlike the viscous term of a lubricated joint, so that it fades with
    contact: a foot that carries nothing feels no friction.

    Attributes (leaves of any batch shape):
        k: friction per load and slip speed [s/m].

    Raises:
        ArgumentError: k below 0.
    """

    name: ClassVar[str] = "viscous"
    k: Parameter = parameter("friction per slip", "$k$", "s/m", minimum=0.0)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return -self.k * normal_force * slip_speed

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """mu_static F_N at the seed's v0, and without bound beyond."""
        return cls(k=by_numpy(lambda _, mu, v0: mu / v0, seed.mu_static, seed.v0))
