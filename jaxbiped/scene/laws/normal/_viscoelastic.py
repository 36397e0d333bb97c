"""Viscoelastic normal laws: a spring beside a damper that grows with a power of the depth."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.scene.laws._abstract_laws import (
    AbstractDampedLaw,
    AbstractHertzianLaw,
    depth_in_contact,
    pushing,
)
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer, Standing


class AbstractMatchedLaw(AbstractDampedLaw):
    """A damped law that resembles the seed's in how a mass stands on it."""

    @classmethod
    def like_seed(cls, seed: RistowSchafer, standing: Standing) -> Self:
        """The law with the same penetration under the weight and the same damping ratio there."""
        return cls.from_weight(**standing.arguments())


class KelvinVoigt(AbstractMatchedLaw):
    """F_N = K δ + D δ̇ while δ > 0, never below zero (no adhesion).

    The damper acts at once, so the force jumps by D δ̇ at touchdown: `jumps_at_touchdown`. It
    returns to zero at δ̇ = −(K/D) δ, while the foot is still in the ground.

    Source: Goldsmith, Impact (1960).

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/m].
        D: contact damping [N·s/m].

    Raises:
        ArgumentError: K is not above 0, or D is below 0.
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


class KuwabaraKono(AbstractMatchedLaw, AbstractHertzianLaw):
    """F_N = K δ^{3/2} + gamma δ^{1/2} δ̇ while δ > 0, never below zero (no adhesion).

    With weak damping, the restitution falls with the approach speed as 1 − e ∝ (v⁻)^{1/5}. The
    force begins as δ^{1/2}, so its slope is unbounded just after touchdown. It returns to zero at
    δ̇ = −(K/gamma) δ, while the foot is still in the ground.

    Source: Kuwabara and Kono, Japanese Journal of Applied Physics 26 (1987) 1230.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/m^1.5].
        gamma: contact damping [N·s/m^1.5].

    Raises:
        ArgumentError: K is not above 0, or gamma is below 0.
    """

    name: ClassVar[str] = "kuwabara-kono"
    steep_at_touchdown: ClassVar[bool] = True
    K: Parameter = parameter("contact stiffness", "$K$", "N/m^1.5", positive=True)
    gamma: Parameter = parameter("contact damping", r"$\gamma$", "N s/m^1.5", minimum=0.0)

    @staticmethod
    def damping_coefficient(damper: Scalar, penetration: Scalar, weight: Scalar) -> Scalar:
        return damper / jnp.sqrt(penetration)

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        depth = depth_in_contact(penetration)
        return pushing(penetration, jnp.sqrt(depth) * (self.K * depth + self.gamma * rate))

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """The reaction over √δ; out of contact, its limit at touchdown."""
        return (self.K * jnp.where(penetration > 0.0, penetration, 0.0) + self.gamma * rate,)


class Tsuji(AbstractMatchedLaw, AbstractHertzianLaw):
    """F_N = K δ^{3/2} + gamma δ^{1/4} δ̇ while δ > 0, never below zero (no adhesion).

    The restitution of a mass m that drops onto it depends only on gamma/√(m K), not on the speed.
    The force begins as δ^{1/4}, so its slope is unbounded just after touchdown. It returns to zero
    at δ̇ = −(K/gamma) δ^{5/4}, while the foot is still in the ground.

    Source: Tsuji, Tanaka and Ishida, Powder Technology 71 (1992) 239.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/m^1.5].
        gamma: contact damping [N·s/m^1.25].

    Raises:
        ArgumentError: K is not above 0, or gamma is below 0.
    """

    name: ClassVar[str] = "tsuji"
    steep_at_touchdown: ClassVar[bool] = True
    K: Parameter = parameter("contact stiffness", "$K$", "N/m^1.5", positive=True)
    gamma: Parameter = parameter("contact damping", r"$\gamma$", "N s/m^1.25", minimum=0.0)

    @staticmethod
    def damping_coefficient(damper: Scalar, penetration: Scalar, weight: Scalar) -> Scalar:
        return damper / _fourth_root(penetration)

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        depth = depth_in_contact(penetration)
        root = _fourth_root(depth)
        return pushing(penetration, root * (self.K * depth * root + self.gamma * rate))

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """The reaction over δ^{1/4}; out of contact, its limit at touchdown."""
        depth = depth_in_contact(penetration)
        held = jnp.where(penetration > 0.0, self.K * depth * _fourth_root(depth), 0.0)
        return (held + self.gamma * rate,)


def _fourth_root(x: Scalar) -> Scalar:
    return jnp.sqrt(jnp.sqrt(x))
