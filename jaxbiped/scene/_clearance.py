"""Clearance rules: which feet may touch the ground."""

import abc
import contextlib
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._jax_versions import untraced
from jaxbiped._types import Scalar, is_traced
from jaxbiped.scene._bodies import check_name


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
    """Raises `ArgumentError` for a rule that, at random rates, tells a leg from its image.

    The `images` are numbers of legs. A rule with numbers that JAX traces is not asked.
    """
    if type(rule) in (StanceRotation, AlwaysTouching) or is_traced(rule):
        return

    def admitted(rate: Scalar) -> Scalar:
        answers = [rule.admits(leg, rate) for leg in legs]
        return jnp.asarray([True if answer is None else answer for answer in answers])

    rates = 10.0 * np.random.default_rng(0).standard_normal(100)
    table = np.ones((1, len(legs)), bool)
    with contextlib.suppress(Exception), untraced():  # a rule that fails is refused where it acts
        table = np.asarray(jax.vmap(admitted)(jnp.asarray(rates)), bool)
    unlike = np.argwhere(table != table[:, list(images)])
    if unlike.size:
        place, leg = map(int, unlike[0])
        raise ArgumentError(
            f"clearance = {type(rule).__name__} admits leg {legs[leg]!r} and leg "
            f"{legs[images[leg]]!r} differently at a rate of {rates[place]:.3g} rad/s, which is "
            "not allowed for a cycle whose legs are exchanged by the mirror: treat both alike, or "
            "leave the mirror out."
        )
