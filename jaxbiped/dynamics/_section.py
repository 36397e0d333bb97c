"""Poincaré sections: where an orbit is looked at, once a cycle."""

import abc
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._contacts import feet, touches
from jaxbiped.dynamics._state import RigidState


class AbstractSection(eqx.Module):
    """A surface that the orbit crosses: a function of the state rises through zero.

    It is looked at with the legs' names as they are and exchanged, so that no arrival depends on
    which leg is called 1.

    Attributes:
        alternates: whether each arrival is another leg's than the one before, the first one another
            than that which stands alone at the start.
        leg_2_stands: whether leg 2 stands after an arrival, which names the legs.
    """

    alternates: ClassVar[bool] = False
    leg_2_stands: ClassVar[bool] = False

    @abc.abstractmethod
    def value(self, args: PyTree, y: PyTree) -> Scalar:
        """The function that rises through zero, of the state just *after* the arrival."""

    @abc.abstractmethod
    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        """Whether a crossing there is an arrival (boolean)."""


class MidStance(AbstractSection):
    """The leg that stands, leg 2, passes the slope's normal on its way back, and carries."""

    leg_2_stands: ClassVar[bool] = True

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return -y.theta_2

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if isinstance(y, RigidState):
            return jnp.asarray(True)
        return touches(feet(args, y).foot_2)


class HeelStrike(AbstractSection):
    """The foot ahead comes down; by then its leg is called leg 2, the new stance leg."""

    alternates: ClassVar[bool] = True
    leg_2_stands: ClassVar[bool] = True

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        if isinstance(y, RigidState):
            # Both feet touch where the angles are opposite; then the one ahead comes down.
            return -(y.theta_1 + y.theta_2)
        return feet(args, y).foot_2.penetration

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if isinstance(y, RigidState):
            return y.theta_2 > y.theta_1
        both = feet(args, y)
        return touches(both.foot_2) & (both.foot_2.x > both.foot_1.x)


class Section(AbstractSection):
    """Any scalar function of the state, `function(args, state)`.

    Attributes:
        function: rises through zero at an arrival.
        condition: `condition(args, state)`, whether a crossing counts; None: every one does.
    """

    function: Callable[[PyTree, PyTree], Scalar] = eqx.field(static=True)
    condition: Callable[[PyTree, PyTree], Scalar] | None = eqx.field(static=True, default=None)

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        return self.function(args, y)

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        if self.condition is None:
            return jnp.asarray(True)
        return self.condition(args, y)
