"""Weight on a normal law: its parameters from how a mass stands on it."""

import abc
from typing import ClassVar, Self

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_at_least, check_not_negative, check_positive
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.compiler import kept_alone
from jaxbiped.scene.laws._abstract_laws import AbstractNormalLaw, hertz_energy, hertz_force


class AbstractDampedLaw(AbstractNormalLaw):
    """A normal law with a stiffness K, its own damping coefficient, and perhaps an exponent n.

    Attributes:
        exponent: default exponent of the stiffness. A property of the class.
    """

    exponent: ClassVar[float] = 1.5

    @staticmethod
    @abc.abstractmethod
    def damping_coefficient(damper: Scalar, penetration: Scalar, weight: Scalar) -> Scalar:
        """The law's coefficient with the linear damper `damper` [N·s/m] at rest.

        The weight [N] rests at the penetration [m].
        """

    @classmethod
    def from_weight(
        cls,
        *,
        mass: Parameter,
        penetration: Parameter,
        damping_ratio: Parameter,
        g: Parameter = 9.8,
        **n: Parameter,
    ) -> Self:
        """The law on which a mass has this penetration and this damping ratio.

        Args:
            mass: mass that stands on the law [kg].
            penetration: penetration under its weight [m].
            damping_ratio: damping ratio of small oscillations about that penetration [–].
            g: gravitational acceleration [m/s²].
            n: exponent [–], for a law that has one as a parameter. Default: 1.5.

        Raises:
            ArgumentError: mass, penetration or g is not above 0, damping_ratio is below 0, or n is
                below 1.
        """
        told = {"n": cls.exponent, **n}
        K, damper = matched_to_weight(
            mass=mass, penetration=penetration, damping_ratio=damping_ratio, g=g, **told
        )
        given = map(as_float, (penetration, mass, g))
        return cls(K, _coefficient(cls, damper, *given), **n)


class AbstractHertzianLaw(AbstractDampedLaw):
    """A damped law with Hertz's elastic part, K δⁿ; its exponent is n, if it has one."""

    K: eqx.AbstractVar[Parameter]

    def elastic_force(self, penetration: Scalar) -> Scalar:
        return hertz_force(self.K, getattr(self, "n", self.exponent), penetration)

    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return hertz_energy(self.K, getattr(self, "n", self.exponent), penetration)


def matched_to_weight(
    *,
    mass: Parameter,
    penetration: Parameter,
    g: Parameter,
    damping_ratio: Parameter = 0.0,
    n: Parameter = 1.5,
) -> tuple[Scalar, Scalar]:
    """The stiffness K [N/mⁿ] and damper d [N·s/m] for this penetration and damping ratio.

    K δⁿ carries the weight m g at the penetration δ. There the linear stiffness is
    k = dF/dδ = n m g/δ, and the linear damper is d = dF/dδ̇ = 2 ζ √(k m).

    Raises:
        ArgumentError: mass, penetration or g is not above 0, damping_ratio is below 0, or n is
            below 1.
    """
    mass, penetration, g, damping_ratio, n = (
        as_float(value) for value in (mass, penetration, g, damping_ratio, n)
    )
    check_positive("mass", mass, "kg")
    check_positive("penetration", penetration, "m")
    check_positive("g", g, "m/s^2")
    check_not_negative("damping_ratio", damping_ratio)
    check_at_least("n", n, "1", 1.0)
    return _stiffness_and_damper(mass, penetration, g, damping_ratio, n)


@kept_alone
def _coefficient(
    law: type[AbstractDampedLaw], damper: Scalar, penetration: Scalar, mass: Scalar, g: Scalar
) -> Scalar:
    return law.damping_coefficient(damper, penetration, mass * g)


@kept_alone
def _stiffness_and_damper(
    mass: Scalar, penetration: Scalar, g: Scalar, damping_ratio: Scalar, n: Scalar
) -> tuple[Scalar, Scalar]:
    weight = mass * g
    slope = n * weight / penetration
    return weight / penetration**n, 2.0 * damping_ratio * jnp.sqrt(slope * mass)
