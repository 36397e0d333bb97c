"""The seed's normal law, Hertz stiffness with damping that grows with depth; its smooth twin."""

from typing import ClassVar, NamedTuple, Self

import jax.numpy as jnp
import numpy as np

from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.compiler import kept_alone
from jaxbiped.scene.laws._abstract_laws import (
    AbstractHertzianLaw,
    AbstractNormalLaw,
    depth_in_contact,
    hertz_energy,
    hertz_force,
    power,
    pushing,
    smooth_ramp,
)


class RistowSchafer(AbstractHertzianLaw):
    """F_N = K δⁿ + c δ δ̇ while δ > 0, never below zero (no adhesion).

    Source: the seed paper, section 2.2, after Ristow and Schäfer et al. The reaction leaves zero at
    δ̇ = −(K/c) δⁿ⁻¹, while the foot is still in the ground.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/mⁿ].
        c: contact damping [N·s/m²].
        n: exponent of the contact law [–].

    Raises:
        ArgumentError: K is not above 0, c is below 0, or n is below 1.
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
        """The reaction divided by the penetration, which leaves zero where the reaction does."""
        depth = depth_in_contact(penetration)
        return (self.K * power(depth, self.n - 1.0) + self.c * rate,)

    @classmethod
    def like_seed(cls, seed: Self, standing: "Standing") -> Self:
        """The seed's law."""
        return seed


class Standing(NamedTuple):
    """How a mass stands on the seed's law, computed when it is needed.

    Attributes:
        law: the seed's law.
        mass: mass that stands on it [kg].
        g: gravitational acceleration [m/s²].
    """

    law: RistowSchafer
    mass: Scalar
    g: Scalar

    @property
    def penetration(self) -> Scalar:
        """Penetration under its weight [m]."""
        return _rest_penetration(self.mass, self.g, self.law.K, self.law.n)

    @property
    def damping_ratio(self) -> Scalar:
        """Damping ratio of small oscillations about that penetration [–]."""
        return _damping_ratio(self.penetration, self.mass, self.g, self.law.c, self.law.n)

    def arguments(self) -> dict[str, Scalar]:
        """Arguments of `from_weight`."""
        names = ("mass", "penetration", "damping_ratio", "g")
        return {name: getattr(self, name) for name in names}


@kept_alone
def _rest_penetration(mass: Scalar, g: Scalar, K: Scalar, n: Scalar) -> Scalar:
    return (mass * g / K) ** (1.0 / n)


@kept_alone
def _damping_ratio(penetration: Scalar, mass: Scalar, g: Scalar, c: Scalar, n: Scalar) -> Scalar:
    stiffness = n * mass * g / penetration
    return 0.5 * c * penetration / jnp.sqrt(stiffness * mass)


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_GAUSS = [(0.5 * (1.0 + float(x)), 0.5 * float(w)) for x, w in zip(_NODES, _WEIGHTS, strict=True)]


class SmoothRistowSchafer(AbstractNormalLaw):
    """`RistowSchafer` made twice continuously differentiable, with the same K, c and n.

    The penetration is passed through a C² ramp of width `depth_width`, and the force through one of
    width `force_width`. Above both widths, the law is the original; out of contact, it is exactly
    zero. `docs/laws.md` shows how much this changes the gait.

    Attributes (leaves of any batch shape):
        K: contact stiffness [N/mⁿ].
        c: contact damping [N·s/m²].
        n: exponent [–].
        depth_width: penetration over which touchdown is rounded [m].
        force_width: force over which the clamp at zero is rounded [N].

    Raises:
        ArgumentError: K or a width is not above 0, c is below 0, or n is below 1.
    """

    name: ClassVar[str] = "smooth-ristow-schafer"
    K: Parameter = parameter("contact stiffness", "$K$", "N/m^n", positive=True)
    c: Parameter = parameter("contact damping", "$c$", "N s/m^2", minimum=0.0)
    n: Parameter = parameter("contact exponent", "$n$", minimum=1.0, default=1.5)
    depth_width: Parameter = parameter(
        "rounding of depth", r"$w_\delta$", "m", positive=True, default=1e-5
    )
    force_width: Parameter = parameter(
        "rounding of force", "$w_F$", "N", positive=True, default=1.0
    )

    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        depth = smooth_ramp(penetration, self.depth_width)
        force = hertz_force(self.K, self.n, depth) + self.c * depth * rate
        return smooth_ramp(force, self.force_width)

    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        return ()

    def elastic_force(self, penetration: Scalar) -> Scalar:
        return hertz_force(self.K, self.n, smooth_ramp(penetration, self.depth_width))

    def elastic_energy(self, penetration: Scalar) -> Scalar:
        # On the ramp by quadrature (the integrand is smooth there), above it in closed form.
        width = jnp.asarray(self.depth_width)
        inside = penetration < width
        upper = jnp.where(inside, jnp.maximum(penetration / width, 0.0), 1.0)
        on_ramp = sum(
            weight * upper * self.elastic_force(node * upper * width) for node, weight in _GAUSS
        )
        above = hertz_energy(self.K, self.n, jnp.where(inside, width, penetration))
        return width * on_ramp + above - hertz_energy(self.K, self.n, width)

    @classmethod
    def like_seed(cls, seed: RistowSchafer, standing: Standing) -> Self:
        """The seed's own K, c and n."""
        return cls(K=seed.K, c=seed.c, n=seed.n)
