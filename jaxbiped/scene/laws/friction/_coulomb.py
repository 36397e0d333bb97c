"""Coulomb friction, regularised at rest."""

from typing import ClassVar, Self

from jaxbiped._jax_versions import tanh
from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar, by_numpy
from jaxbiped.scene.laws._abstract_laws import AbstractFrictionLaw
from jaxbiped.scene.laws.friction._bengisu_akay import BengisuAkay


class RegularisedCoulomb(AbstractFrictionLaw):
    """F = mu F_N tanh(V_T / v_d), opposing V_T. Smooth everywhere, no Stribeck peak.

    Attributes (leaves of any batch shape):
        mu: coefficient of friction [–].
        v_d: slip speed over which the force builds up [m/s].

    Raises:
        ArgumentError: mu below 0 or v_d not above 0.
    """

    name: ClassVar[str] = "coulomb"
    builds_up_over: ClassVar[str | None] = "v_d"
    mu: Parameter = parameter("friction coefficient", r"$\mu$", minimum=0.0)
    v_d: Parameter = parameter("build-up speed", "$v_d$", "m/s", positive=True)

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        return -self.mu * normal_force * tanh(slip_speed / self.v_d)

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        return ()

    @classmethod
    def like_seed(cls, seed: BengisuAkay) -> Self:
        """The kinetic coefficient, and the slope 2 mu/v0 at rest: v_d = v0/2."""
        return cls(mu=seed.mu_kinetic, v_d=by_numpy(lambda _, v0: 0.5 * v0, seed.v0))
