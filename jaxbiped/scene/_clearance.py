"""Rules for which foot may touch the ground: how a walker without knees clears it."""

import abc

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._types import Scalar


class AbstractClearance(eqx.Module):
    """Decides from a leg's rotation whether its foot may touch."""

    @abc.abstractmethod
    def admits(self, leg_rate: Scalar) -> Scalar | None:
        """Whether the foot of a leg that turns at `leg_rate` [rad/s] may touch: a boolean.

        None stands for "always", so that nothing of the rule is left in the compiled program.
        """


class StanceRotation(AbstractClearance):
    """A foot touches only while its leg rotates as a stance leg does, θ̇ < 0.

    Source: the seed paper, section 2.2 ("ω > 0" about its y axis): the swinging foot does not
    scuff. Its side effect: a stance leg that comes to rest loses its ground, so `simulate` ends
    such a walk as stopped.
    """

    def admits(self, leg_rate: Scalar) -> Scalar:
        return jnp.asarray(leg_rate < 0.0)


class AlwaysTouching(AbstractClearance):
    """Every foot that reaches the ground touches it; a swinging foot scuffs."""

    def admits(self, leg_rate: Scalar) -> None:
        return None
