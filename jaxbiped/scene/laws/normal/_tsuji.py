"""Tsuji's law, whose restitution does not depend on the speed of impact."""

from typing import Self

import jax.numpy as jnp

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import (
    AbstractNormalLaw,
    depth_in_contact,
    hertz_energy,
    hertz_force,
    pushing,
)
from jaxbiped.scene.laws.normal._weight_on_law import matched_to_weight


class Tsuji(AbstractNormalLaw):
    """F_N = K δ^{3/2} + gamma δ^{1/4} δ̇ while δ > 0, never below zero (no adhesion).

    A mass m that drops onto it leaves with a restitution that depends on gamma/√(m K) alone, not
    on the speed. The force begins as δ^{1/4}, so its slope is without bound just past touchdown.
    It comes back to zero at δ̇ = −(K/gamma) δ^{5/4}, while the foot is still indented.

    Source: Tsuji, Tanaka and Ishida, Powder Technology 71 (1992) 239.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/m^1.5].
        gamma: contact damping [N·s/m^1.25].

    Raises:
        ArgumentError: K not above 0 or gamma below 0.
    """

    K: Parameter = parameter("contact stiffness", "$K$", "N/m^1.5", positive=True)
    gamma: Parameter = parameter("contact damping", r"$\gamma$", "N s/m^1.25", minimum=0.0)

    @classmethod
    def from_weight(
        cls,
        *,
        mass: Parameter,
        penetration: Parameter,
        damping_ratio: Parameter,
        g: Parameter = 9.8,
    ) -> Self:
        """The law on which a mass stands and oscillates as told.

        Args:
            mass: what stands on the law [kg].
            penetration: how deep it stands [m].
            damping_ratio: of small oscillations about that [–].
            g: gravitational acceleration [m/s²].

        Raises:
            ArgumentError: mass, penetration or g not above 0, or damping_ratio below 0.
        """
        K, damper = matched_to_weight(
            mass=mass, penetration=penetration, damping_ratio=damping_ratio, g=g
        )
        return cls(K=K, gamma=damper / _fourth_root(as_float(penetration)))

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        depth = depth_in_contact(penetration)
        root = _fourth_root(depth)
        return pushing(penetration, root * (self.K * depth * root + self.gamma * rate))

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """The reaction over δ^{1/4}; out of contact, its limit at touchdown."""
        depth = depth_in_contact(penetration)
        held = jnp.where(penetration > 0.0, self.K * depth * _fourth_root(depth), 0.0)
        return (held + self.gamma * rate,)

    def elastic_force(self, penetration: Scalar) -> Scalar:
        return hertz_force(self.K, 1.5, penetration)

    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return hertz_energy(self.K, 1.5, penetration)


def _fourth_root(x: Scalar) -> Scalar:
    return jnp.sqrt(jnp.sqrt(x))
