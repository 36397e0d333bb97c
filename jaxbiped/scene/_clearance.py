"""Clearance rules: which feet may touch the ground."""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._types import Scalar
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

    leg: str = eqx.field(static=True, converter=_leg_name)

    def __check_init__(self) -> None:
        check_name("leg", self.leg)

    def admits(self, leg: str, leg_rate: Scalar) -> bool | None:
        return None if leg == self.leg else False
