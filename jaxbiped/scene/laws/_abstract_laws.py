"""Interfaces of the laws of contact: normal force, friction, and friction by bristles."""

import abc
from typing import Any, ClassVar

import jax.numpy as jnp

from jaxbiped._parameter_declaration import AbstractNamedPart
from jaxbiped._types import Scalar

NORMAL_LAWS: dict[str, type["AbstractNormalLaw"]] = {}
"""Each law of the normal force by name."""

FRICTION_LAWS: dict[str, type["AbstractFrictionLaw | AbstractBristleLaw"]] = {}
"""Each law of the tangential force by name. Those with bristles have states of their own."""


class AbstractNormalLaw(AbstractNamedPart):
    """Normal force of the ground on a foot as a function of penetration and its rate.

    A law with a `name` is in `NORMAL_LAWS`, and has a classmethod `like_seed(seed, standing)`,
    which makes the law that resembles the seed's `RistowSchafer`.

    Attributes:
        jumps_at_touchdown: whether the force itself, not its derivatives alone, jumps where a
            foot that comes down begins to touch. A property of the class.
        steep_at_touchdown: whether it is infinitely steep there, in the depth or in its rate.
    """

    catalogue: ClassVar[dict[str, Any]] = NORMAL_LAWS
    needed: ClassVar[tuple[str, ...]] = ("like_seed",)
    jumps_at_touchdown: ClassVar[bool] = False
    steep_at_touchdown: ClassVar[bool] = False

    @abc.abstractmethod
    def force(self, penetration: Scalar, rate: Scalar) -> Scalar:
        """Normal force [N], never negative, zero where `penetration` [m] is not above zero.

        `rate` [m/s] is the rate of penetration, positive while the foot goes in.
        """

    @abc.abstractmethod
    def elastic_force(self, penetration: Scalar) -> Scalar:
        """The part of the force that stores energy [N], as if the foot were held at rest."""

    @abc.abstractmethod
    def switches(self, penetration: Scalar, rate: Scalar) -> tuple[Scalar, ...]:
        """Functions whose zeros are where the force's first derivatives jump inside contact.

        None for a law that is smooth for every `penetration` above zero. Touchdown itself is
        known to everyone and not among them.
        """

    @abc.abstractmethod
    def elastic_energy(self, penetration: Scalar) -> Scalar:
        """Energy stored in the contact [J]: the integral of `elastic_force`."""


class AbstractFrictionLaw(AbstractNamedPart):
    """Tangential force of the ground on a foot as a function of normal force and slip speed.

    A law with a `name` is in `FRICTION_LAWS`, and has a classmethod `like_seed(seed)`, which makes
    the law that resembles the seed's `BengisuAkay`.

    Attributes:
        builds_up_over: name of the parameter that is the slip speed [m/s] over which the force
            builds up from rest, which steps must resolve; None for a law without one. A property
            of the class.
    """

    catalogue: ClassVar[dict[str, Any]] = FRICTION_LAWS
    needed: ClassVar[tuple[str, ...]] = ("like_seed",)
    builds_up_over: ClassVar[str | None] = None

    @abc.abstractmethod
    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        """Tangential force [N] along the slope, opposing `slip_speed` [m/s]."""

    @abc.abstractmethod
    def switches(self, slip_speed: Scalar) -> tuple[Scalar, ...]:
        """Functions whose zeros are where a first or second derivative in the slip speed jumps."""


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


class AbstractBristleLaw(AbstractNamedPart):
    """Friction by bristles whose deflection is a state of its own, one number for each foot.

    The number is what the bristles' stiffness makes of their deflection, as a share of the normal
    force [–]: a deflection would be too small for the tolerances of the other components. Bristles
    work into contact with the load, w = F_N/(F_N + engaging_load), and relax out of it:

        ḃ = w (rate of the law) − (1 − w) relaxation b

    so that a foot lands with straight bristles and nothing jumps as it does. With a `name` it is in
    `FRICTION_LAWS` and has `like_seed`, as an `AbstractFrictionLaw`.
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
        """Friction as a share of the normal force [–], of the sign of the slip that it opposes."""

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
        """The slip speed: a bent bristle's rate has a corner where it changes sign."""
        return (slip_speed,)
