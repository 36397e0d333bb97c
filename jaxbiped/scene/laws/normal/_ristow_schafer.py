"""The seed's normal law: Hertz stiffness with a damper that grows with penetration."""

from typing import Self

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import (
    AbstractNormalLaw,
    depth_in_contact,
    hertz_energy,
    hertz_force,
    power,
    pushing,
)
from jaxbiped.scene.laws.normal._weight_on_law import matched_to_weight


class RistowSchafer(AbstractNormalLaw):
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

    K: Parameter = parameter("contact stiffness", "$K$", "N/m^n", positive=True)
    c: Parameter = parameter("contact damping", "$c$", "N s/m^2", minimum=0.0)
    n: Parameter = parameter("contact exponent", "$n$", minimum=1.0, default=1.5)

    @classmethod
    def from_weight(
        cls,
        *,
        mass: Parameter,
        penetration: Parameter,
        damping_ratio: Parameter,
        g: Parameter = 9.8,
        n: Parameter = 1.5,
    ) -> Self:
        """The law on which a mass stands and oscillates as told.

        Args:
            mass: what stands on the law [kg].
            penetration: how deep it stands [m].
            damping_ratio: of small oscillations about that [–].
            g: gravitational acceleration [m/s²].
            n: exponent [–].

        Raises:
            ArgumentError: mass, penetration or g not above 0, damping_ratio below 0, n below 1.
        """
        K, damper = matched_to_weight(
            mass=mass, penetration=penetration, damping_ratio=damping_ratio, g=g, n=n
        )
        return cls(K=K, c=damper / as_float(penetration), n=n)

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
