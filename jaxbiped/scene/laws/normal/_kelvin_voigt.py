"""Kelvin and Voigt's law: a linear spring beside a linear damper."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.laws._abstract_laws import pushing
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer
from jaxbiped.scene.laws.normal._weight_on_law import AbstractDampedLaw, Standing


class KelvinVoigt(AbstractDampedLaw):
    """F_N = K δ + D δ̇ while δ > 0, never below zero (no adhesion).

    The damper acts at once, so the force jumps by D δ̇ at touchdown: `jumps_at_touchdown`. It
    comes back to zero at δ̇ = −(K/D) δ, while the foot is still indented.

    Source: Goldsmith, Impact (1960).

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/m].
        D: contact damping [N·s/m].

    Raises:
        ArgumentError: K not above 0 or D below 0.
    """

    name: ClassVar[str] = "kelvin-voigt"
    K: Parameter = parameter("contact stiffness", "$K$", "N/m", positive=True)
    D: Parameter = parameter("contact damping", "$D$", "N s/m", minimum=0.0)

    jumps_at_touchdown: ClassVar[bool] = True
    exponent: ClassVar[float] = 1.0

    @staticmethod
    def damping_coefficient(damper: Scalar, penetration: Scalar, weight: Scalar) -> Scalar:
        return damper

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        return pushing(penetration, self.K * penetration + self.D * rate)

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """The reaction before the clamp; out of contact, its limit at touchdown."""
        return (self.elastic_force(penetration) + self.D * rate,)

    def elastic_force(self, penetration: Scalar) -> Scalar:
        return jnp.where(penetration > 0.0, self.K * penetration, 0.0)

    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return 0.5 * self.elastic_force(penetration) * penetration

    @classmethod
    def like_seed(cls, seed: RistowSchafer, standing: Standing) -> Self:
        """The same penetration under the weight, with the same damping ratio about it."""
        return cls.from_weight(**standing.arguments())
