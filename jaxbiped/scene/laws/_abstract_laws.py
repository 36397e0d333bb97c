"""Interfaces of the laws of contact: normal force, with how a weight rests on it, and friction."""

import abc
from typing import Any, ClassVar, Self

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_at_least, check_not_negative, check_positive
from jaxbiped._parameter_declaration import AbstractNamedPart
from jaxbiped._types import Parameter, Scalar, as_float
from jaxbiped.compiler import kept_alone

NORMAL_LAWS: dict[str, type["AbstractNormalLaw"]] = {}
"""Each law of the normal force by name."""

FRICTION_LAWS: dict[str, type["AbstractFrictionLaw | AbstractBristleLaw"]] = {}
"""Each law of the tangential force by name. Those with bristles have states of their own."""


class AbstractNormalLaw(AbstractNamedPart):
    """Normal force of the ground on a foot as a function of penetration and its rate.

    A law with a `name` is in `NORMAL_LAWS`, and has a classmethod `like_seed(seed, standing)`,
    which makes the law that resembles the seed's `RistowSchafer`.

    Attributes:
        jumps_at_touchdown: whether the force itself, and not only its derivatives, jumps when a
            foot that comes down begins to touch. A property of the class.
        steep_at_touchdown: whether the force is infinitely steep there, in the depth or its rate.
    """

    catalogue: ClassVar[dict[str, Any]] = NORMAL_LAWS
    needed: ClassVar[tuple[str, ...]] = ("like_seed",)
    jumps_at_touchdown: ClassVar[bool] = False
    steep_at_touchdown: ClassVar[bool] = False

    @abc.abstractmethod
    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        """Normal force [N], never negative, zero if `penetration` [m] is not above zero.

        `rate` [m/s] is the rate of penetration, positive while the foot moves into the ground.
        """

    @abc.abstractmethod
    def elastic_force(self, penetration: Scalar) -> Scalar:
        """The part of the force that stores energy [N], as if the foot were held at rest."""

    @abc.abstractmethod
    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """Functions with zeros at which the force's first derivatives jump inside contact.

        There are none if a law is smooth for every `penetration` above zero. Touchdown itself is
        always taken into account and is not among them.
        """

    @abc.abstractmethod
    def elastic_energy(self, penetration: Scalar) -> Scalar:
        """Energy stored in the contact [J]: the integral of `elastic_force`."""


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


class AbstractFrictionLaw(AbstractNamedPart):
    """Tangential force of the ground on a foot as a function of normal force and slip speed.

    A law with a `name` is in `FRICTION_LAWS`, and has a classmethod `like_seed(seed)`, which makes
    the law that resembles the seed's `BengisuAkay`.

    Attributes:
        builds_up_over: name of the parameter for the slip speed [m/s] over which the force builds
            up from rest, and which steps must resolve; None for a law without one. A property of
            the class.
    """

    catalogue: ClassVar[dict[str, Any]] = FRICTION_LAWS
    needed: ClassVar[tuple[str, ...]] = ("like_seed",)
    builds_up_over: ClassVar[str | None] = None

    @abc.abstractmethod
    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        """Tangential force [N] along the slope, opposing `slip_speed` [m/s]."""

    @abc.abstractmethod
    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """Functions with zeros at which a first or second derivative in the slip speed jumps."""


class AbstractBristleLaw(AbstractNamedPart):
    """Friction by bristles whose deflection is a state, with one number b for each foot.

    The number is the elastic force of the deflected bristles as a share of the normal force [–]; a
    deflection would be too small for the tolerances of the other components. The load engages the
    bristles with the weight w = F_N/(F_N + engaging_load); out of contact, they relax:

        ḃ = w (rate of the law) − (1 − w) relaxation b

    A foot therefore lands with straight bristles, and nothing jumps at touchdown. A law with a
    `name` is in `FRICTION_LAWS` and has `like_seed`, like an `AbstractFrictionLaw`.
    """

    catalogue: ClassVar[dict[str, Any]] = FRICTION_LAWS
    needed: ClassVar[tuple[str, ...]] = ("like_seed",)

    @abc.abstractmethod
    def engagement(self) -> tuple[Scalar, Scalar]:
        """Engaging load [N] and relaxation [1/s]."""

    @abc.abstractmethod
    def rate(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Rate of the bristle's share of the load [1/s] in full contact."""

    @abc.abstractmethod
    def coefficient(self, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Friction as a share of the normal force [–], with the sign of the slip it opposes."""

    def force(self, normal_force: Scalar, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Tangential force [N] along the slope."""
        return -normal_force * self.coefficient(slip_speed, bristle)

    def bristle_rate(self, normal_force: Scalar, slip_speed: Scalar, bristle: Scalar) -> Scalar:
        """Rate of the bristle's share of the load [1/s], in contact or out of it."""
        load, relaxation = self.engagement()
        engaged = normal_force / (normal_force + load)
        rate = engaged * self.rate(slip_speed, bristle)
        return rate - (1.0 - engaged) * relaxation * bristle

    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """The slip speed: the rate of a bent bristle has a corner where the slip changes sign."""
        return (slip_speed,)


def power(base: Scalar, exponent: Scalar | float) -> Scalar:
    """`base ** exponent` for a positive base, with one exponential shared by all derivatives."""
    return jnp.exp(exponent * jnp.log(base))


def depth_in_contact(penetration: Scalar) -> Scalar:
    """The penetration where above zero, else 1 m: powers of it have finite derivatives."""
    return jnp.where(penetration > 0.0, penetration, 1.0)


def pushing(penetration: Scalar, force: Scalar) -> Scalar:
    """`force` [N] in contact and where above zero, else zero: no foot is pulled."""
    return jnp.where((penetration > 0.0) & (force > 0.0), force, 0.0)


def hertz_force(stiffness: Scalar, exponent: Scalar | float, penetration: Scalar) -> Scalar:
    """K δⁿ where δ > 0, else zero [N]; every derivative is finite at δ = 0."""
    depth = depth_in_contact(penetration)
    return jnp.where(penetration > 0.0, stiffness * power(depth, exponent), 0.0)


def hertz_energy(stiffness: Scalar, exponent: Scalar | float, penetration: Scalar) -> Scalar:
    """The integral of `hertz_force` over penetration [J]."""
    return hertz_force(stiffness, exponent, penetration) * penetration / (exponent + 1.0)


def smooth_ramp(x: Scalar, width: Scalar) -> Scalar:
    """Zero up to 0, `x` from `width` on, twice continuously differentiable in between."""
    t = jnp.clip(x / width, 0.0, 1.0)
    return x * (t * t * t * (10.0 + t * (6.0 * t - 15.0)))
