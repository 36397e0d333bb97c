"""The ground, a plane slope in gravity with or without a step, and which feet may touch it."""

import abc
import contextlib
import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, are_zero_together, warn
from jaxbiped._jax_versions import untraced
from jaxbiped._parameter_declaration import AbstractPart, parameter
from jaxbiped._types import Parameter, Scalar, is_traced
from jaxbiped.scene._bodies import check_name


class Ground(AbstractPart):
    """An inclined plane that descends towards positive x.

    Attributes (leaves of any batch shape):
        slope: angle of the slope α, downhill positive [rad].
        g: gravitational acceleration [m/s²].

    Raises:
        ArgumentError: the slope is a right angle or more, or g is below 0.
    """

    slope: Parameter = parameter("slope", r"$\alpha$", "rad", size_below=math.pi / 2)
    g: Parameter = parameter("gravity", "$g$", "m/s^2", minimum=0.0, default=9.8)


def check_pulls(ground: Any) -> None:
    """Raises `ArgumentError` where g is known to be 0, for what waits in units of √(l/g)."""
    if are_zero_together(ground.g, 0.0):
        raise ArgumentError(
            "g = 0 is not allowed here: footsteps are waited for in units of √(l/g), which has no "
            "end; give g above 0, or for a walk a duration."
        )


def gravity_on(ground: Any) -> tuple[Scalar, Scalar]:
    """Gravity along the slope, downhill, and onto it [m/s²]."""
    return ground.g * jnp.sin(ground.slope), ground.g * jnp.cos(ground.slope)


class SteppedGround(eqx.Module):
    """A slope on which one leg comes down behind a step, where the ground lies lower.

    Attributes (scalar leaves):
        slope: angle of the slope, downhill positive [rad].
        g: gravitational acceleration [m/s²].
        drop: depth of the step along the slope's normal [m].
        leg: number of that leg, from 0 on.
    """

    slope: Parameter
    g: Parameter
    drop: Scalar
    leg: int = eqx.field(static=True)


def warn_if_steep(ground: Ground, friction: object) -> None:
    """Warns of a slope whose tangent exceeds every coefficient of friction: a walker slides."""
    known = (getattr(friction, name, None) for name in ("mu", "mu_static", "mu_kinetic"))
    largest = [mu for mu in known if mu is not None]
    if not largest or is_traced((ground.slope, *largest)):
        return
    # By NumPy alone: what is traced around a known scene would trace these, too.
    slope, *most = (np.max(np.abs(np.asarray(each))) for each in (ground.slope, *largest))
    mu = max(most)
    if 0.0 < mu < np.tan(slope):
        warn(
            f"slope = {slope:g} rad is steeper than friction can hold, whose coefficient is at "
            f"most {mu:g} (up to {np.arctan(mu):.3g} rad): every walker slides; is the slope in "
            "degrees?"
        )


class AbstractClearance(eqx.Module):
    """A rule that decides from a leg and its rotation whether its feet may touch."""

    @abc.abstractmethod
    def admits(self, leg: str, leg_rate: Scalar) -> Scalar | bool | None:
        """Whether the feet of a leg, by its name, may touch.

        `leg_rate` is the rate of the line from the root point to the mean of its feet [rad/s]. The
        result None means "always" and False "never"; both are known before anything runs, so the
        rule, or the contact, is then left out of the compiled program.
        """


class StanceRotation(AbstractClearance):
    """A foot touches only while its leg rotates as a stance leg does, θ̇ < 0.

    Source: the seed paper, section 2.2 ("ω > 0" about its y axis): the swinging foot does not
    scuff. Its side effect: a stance leg that comes to rest loses its ground, so `simulate` ends
    such a walk as stopped.
    """

    def admits(self, leg: str, leg_rate: Scalar) -> Scalar:
        return jnp.asarray(leg_rate < 0.0)


class AlwaysTouching(AbstractClearance):
    """Every foot that reaches the ground touches it; a swinging foot scuffs."""

    def admits(self, leg: str, leg_rate: Scalar) -> None:
        return None


def _leg_name(leg: Any) -> Any:
    return str(leg) if leg in (1, 2) else leg


class OneFoot(AbstractClearance):
    """Only one leg may touch: a walker in single support, or a leg that is dropped.

    Attributes:
        leg: name of the leg; for `Walker` also the number 1 or 2, which is stored as the name.

    Raises:
        ArgumentError: it is not a name. A scene refuses a leg that it does not have.
    """

    leg: Any = eqx.field(static=True, converter=_leg_name)

    def __check_init__(self) -> None:
        check_name("leg", self.leg)

    def admits(self, leg: str, leg_rate: Scalar) -> bool | None:
        return None if leg == self.leg else False


def check_legs_admitted_alike(rule: Any, legs: Sequence[str], images: Sequence[int]) -> None:
    """Raises `ArgumentError` for a clearance rule that tells a leg from its image by the mirror.

    The rule is asked at random rates; one with numbers that JAX traces is not asked.

    Args:
        rule: the clearance rule.
        legs: names of the legs.
        images: number of each leg's image.
    """
    if isinstance(rule, StanceRotation | AlwaysTouching) or is_traced(rule):
        return

    def admitted(rate: Scalar) -> Scalar:
        answers = [rule.admits(leg, rate) for leg in legs]
        return jnp.asarray([True if answer is None else answer for answer in answers])

    rates = 10.0 * np.random.default_rng(0).standard_normal(100)
    table = np.ones((1, len(legs)), bool)
    with contextlib.suppress(Exception), untraced():  # a rule that fails is refused where it acts
        table = np.asarray(jax.vmap(admitted)(rates), bool)
    unlike = np.argwhere(table != table[:, list(images)])
    if unlike.size:
        place, leg = map(int, unlike[0])
        raise ArgumentError(
            f"clearance = {type(rule).__name__} admits leg {legs[leg]!r} and leg "
            f"{legs[images[leg]]!r} differently at a rate of {rates[place]:.3g} rad/s, which is "
            "not allowed for a cycle whose legs are exchanged by the mirror: treat both alike, or "
            "leave the mirror out."
        )
