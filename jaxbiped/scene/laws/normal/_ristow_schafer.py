"""The seed's normal law: Hertz stiffness with a damper that grows with penetration."""

from typing import ClassVar, Self

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.laws._abstract_laws import (
    depth_in_contact,
    hertz_energy,
    hertz_force,
    power,
    pushing,
)
from jaxbiped.scene.laws.normal._weight_on_law import AbstractDampedLaw, Standing


class RistowSchafer(AbstractDampedLaw):
    """F_N = K δⁿ + c δ δ̇ while δ > 0, never below zero (no adhesion).

    Source: the seed paper, section 2.2, after Ristow and Schäfer et al. The reaction leaves zero
    at δ̇ = −(K/c) δⁿ⁻¹, while the foot is still indented.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/mⁿ].
        c: contact damping [N·s/m²].
        n: exponent [–].

    Raises:
        ArgumentError: K not above 0, c below 0 or n below 1.
    """

    name: ClassVar[str] = "ristow-schafer"
    K: Parameter = parameter("contact stiffness", "$K$", "N/m^n", positive=True)
    c: Parameter = parameter("contact damping", "$c$", "N s/m^2", minimum=0.0)
    n: Parameter = parameter("contact exponent", "$n$", minimum=1.0, default=1.5)

    @staticmethod
    def damping_coefficient(damper: Scalar, penetration: Scalar, weight: Scalar) -> Scalar:
        return damper / penetration

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        depth = depth_in_contact(penetration)
        return pushing(penetration, self.K * power(depth, self.n) + self.c * depth * rate)

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """The reaction over the penetration: it leaves zero where this does."""
        depth = depth_in_contact(penetration)
        return (self.K * power(depth, self.n - 1.0) + self.c * rate,)

    def elastic_force(self, penetration: Scalar) -> Scalar:
        return hertz_force(self.K, self.n, penetration)

    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return hertz_energy(self.K, self.n, penetration)

    @classmethod
    def like_seed(cls, seed: Self, standing: Standing) -> Self:
        """The seed's law."""
        return seed
