"""The ground: a plane slope in gravity, a step in it, and which foot may touch it."""

import abc
import math

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_choice
from jaxbiped._parameter_declaration import AbstractPart, parameter
from jaxbiped._types import Parameter, Scalar


class Ground(AbstractPart):
    """A plane that falls at an angle towards positive x.

    Attributes (leaves of any batch shape):
        slope: angle of the slope α, downhill positive [rad].
        g: gravitational acceleration [m/s²].

    Raises:
        ArgumentError: a slope of a right angle or more, or g below 0.
    """

    slope: Parameter = parameter("slope", r"$\alpha$", "rad", size_below=math.pi / 2)
    g: Parameter = parameter("gravity", "$g$", "m/s^2", minimum=0.0, default=9.8)


class SteppedGround(eqx.Module):
    """A slope on which leg 1's foot comes down behind a step, where the ground lies lower.

    Attributes (scalar leaves):
        slope: angle of the slope, downhill positive [rad].
        g: gravitational acceleration [m/s²].
        drop: depth of the step along the slope's normal [m].
    """

    slope: Parameter
    g: Parameter
    drop: Scalar


def drop_under(ground: object, leg: int) -> Scalar | None:
    """How much lower the ground under a leg's foot lies than the slope [m]; None for even."""
    return ground.drop if isinstance(ground, SteppedGround) and leg == 1 else None


class AbstractClearance(eqx.Module):
    """Decides from a leg and its rotation whether its foot may touch."""

    @abc.abstractmethod
    def admits(self, leg: int, leg_rate: Scalar) -> Scalar | bool | None:
        """Whether the foot of `leg` (1 or 2), which turns at `leg_rate` [rad/s], may touch.

        None stands for "always" and False for "never", known before anything runs: nothing of the
        rule, or of the contact, is then left in the compiled program.
        """


class StanceRotation(AbstractClearance):
    """A foot touches only while its leg rotates as a stance leg does, θ̇ < 0.

    Source: the seed paper, section 2.2 ("ω > 0" about its y axis): the swinging foot does not
    scuff. Its side effect: a stance leg that comes to rest loses its ground, so `simulate` ends
    such a walk as stopped.
    """

    def admits(self, leg: int, leg_rate: Scalar) -> Scalar:
        return jnp.asarray(leg_rate < 0.0)


class AlwaysTouching(AbstractClearance):
    """Every foot that reaches the ground touches it; a swinging foot scuffs."""

    def admits(self, leg: int, leg_rate: Scalar) -> None:
        return None


class OneFoot(AbstractClearance):
    """Only one leg's foot ever touches: a walker in single support, or a leg that is dropped.

    Attributes:
        leg: the leg, 1 or 2.

    Raises:
        ArgumentError: another leg.
    """

    leg: int = eqx.field(static=True)

    def __check_init__(self) -> None:
        check_choice("leg", self.leg, (1, 2))

    def admits(self, leg: int, leg_rate: Scalar) -> bool | None:
        return None if leg == self.leg else False
