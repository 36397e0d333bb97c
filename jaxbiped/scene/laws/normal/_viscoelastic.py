"""Elastic and viscoelastic normal laws: Hertz's spring, alone or beside a damper."""

from typing import ClassVar, Self

import jax.numpy as jnp

from jaxbiped._checks import check_positive, check_within
from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.scene.laws._abstract_laws import (
    AbstractDampedLaw,
    AbstractHertzianLaw,
    AbstractNormalLaw,
    depth_in_contact,
    hertz_energy,
    hertz_force,
    matched_to_weight,
    pushing,
)
from jaxbiped.scene.laws.normal._ristow_schafer import RistowSchafer, Standing


class Hertz(AbstractNormalLaw):
    """F_N = K δⁿ while δ > 0: elastic, without damping.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/mⁿ]; `hertz_stiffness` gives it from materials.
        n: exponent [–].

    Raises:
        ArgumentError: K is not above 0, or n is below 1.
    """

    name: ClassVar[str] = "hertz"
    K: Parameter = parameter("contact stiffness", "$K$", "N/m^n", positive=True)
    n: Parameter = parameter("contact exponent", "$n$", minimum=1.0, default=1.5)

    @classmethod
    def from_weight(
        cls, *, mass: Parameter, penetration: Parameter, g: Parameter = 9.8, n: Parameter = 1.5
    ) -> Self:
        """The law that carries the weight of `mass` [kg] at `penetration` [m].

        Args:
            mass: mass that stands on the law [kg].
            penetration: penetration under its weight [m].
            g: gravitational acceleration [m/s²].
            n: exponent [–].

        Raises:
            ArgumentError: mass, penetration or g is not above 0, or n is below 1.
        """
        K, _ = matched_to_weight(mass=mass, penetration=penetration, g=g, n=n)
        return cls(K=K, n=n)

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        return self.elastic_force(penetration)

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        return ()

    def elastic_force(self, penetration: Scalar) -> Scalar:
        return hertz_force(self.K, self.n, penetration)

    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return hertz_energy(self.K, self.n, penetration)

    @classmethod
    def like_seed(cls, seed: RistowSchafer, standing: Standing) -> Self:
        """The law with the seed's exponent and the same penetration under the weight."""
        return cls.from_weight(
            mass=standing.mass, penetration=standing.penetration, g=standing.g, n=seed.n
        )


def hertz_stiffness(
    *,
    radius: Parameter,
    modulus: Parameter,
    poisson: Parameter,
    ground_modulus: Parameter,
    ground_poisson: Parameter,
) -> Scalar:
    """Stiffness K of the contact of a sphere with a plane, for the exponent 3/2 [N/m^1.5].

    K = 4/3 E* √R with 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂.

    Source: Hertz 1882; Johnson, Contact Mechanics (1985), chapter 4.

    Args:
        radius: radius of the sphere, R [m].
        modulus: Young's modulus of the sphere, E₁ [Pa].
        poisson: Poisson's ratio of the sphere, ν₁ [–].
        ground_modulus: Young's modulus of the plane, E₂ [Pa].
        ground_poisson: Poisson's ratio of the plane, ν₂ [–].

    Returns:
        K [N/m^1.5], a scalar or the shape that the arguments broadcast to.

    Raises:
        ArgumentError: the radius or a modulus is not above 0, or a Poisson's ratio is not that of
            an isotropic material (not above −1, or above 1/2).
    """
    radius, modulus, poisson, ground_modulus, ground_poisson = (
        as_float(value) for value in (radius, modulus, poisson, ground_modulus, ground_poisson)
    )
    check_positive("radius", radius, "m")
    check_positive("modulus", modulus, "Pa")
    check_within("poisson", poisson, -1.0, 0.5, open_below=True)
    check_positive("ground_modulus", ground_modulus, "Pa")
    check_within("ground_poisson", ground_poisson, -1.0, 0.5, open_below=True)
    compliance = (1.0 - poisson**2) / modulus + (1.0 - ground_poisson**2) / ground_modulus
    return 4.0 / 3.0 * jnp.sqrt(radius) / compliance


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
