"""Cycle through the swing foot's lowest place, behind which its height is a coordinate.

Each footstep has two arrivals: the lowest place, then the section. At the first a coordinate gains
the height, so that the response of clearance is a row of the return map's Jacobian, and the
response's derivatives a second variation.
"""

import abc
from typing import ClassVar, cast

import jax.numpy as jnp
import jax.tree_util as jtu
from equinox import AbstractVar
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._contacts import Foot, feet
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._switches import Switch
from jaxbiped.optimise._augmented_cycles import (
    DisturbedCycle,
    SteppedCycle,
    augment,
    joined,
    motion_of,
)
from jaxbiped.scene._scene import AbstractScene, AbstractWalkerScene, Scene
from jaxbiped.variational._hybrid_system import AbstractSystem


def with_clearance(y: PyTree) -> PyTree:
    """A disturbed walker's state, its clearance at zero, on its way to the lowest place."""
    return augment(y, ("clearance", "passed"))


class AbstractLowestSwing(AbstractSystem):
    """A disturbed walker whose `clearance`, in leg lengths, is told at its foot's lowest place.

    `passed` is 1 from there to the section, else 0. Clearances of several footsteps add up, as
    their lengths do.

    Attributes:
        walker: the disturbed walker.
    """

    walker: AbstractVar[AbstractSystem]

    @abc.abstractmethod
    def lowered(self, args: AbstractWalkerScene, y: PyTree) -> Scalar:
        """How much lower than under the foot that swings the ground is where the other stands."""

    def vector_field(self, t: Time, y: PyTree, args: AbstractScene) -> PyTree:
        zero = jnp.zeros_like(y.passed)
        rates = self.walker.vector_field(t, motion_of(y), args)
        return joined(y, rates, {"clearance": zero, "passed": zero})

    def switches(self, args: AbstractScene, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(args, motion_of(y))

    def ending(self, args: AbstractScene, y: PyTree) -> Scalar:
        return self.walker.ending(args, motion_of(y))

    def reset_map(self, args: AbstractWalkerScene, y: PyTree) -> PyTree:
        motion, before = motion_of(y), {"clearance": y.clearance, "passed": y.passed}
        height = _swing_height(args, motion_of(motion)) + self.lowered(args, motion)
        told = {"clearance": y.clearance + height / args.walker.l, "passed": before["passed"] + 1.0}
        at_lowest = joined(y, motion, told)
        after = self.walker.reset_map(args, motion)
        at_section = joined(y, after, before | {"passed": jnp.zeros_like(y.passed)})
        first = y.passed < 0.5
        return jtu.tree_map(lambda a, b: jnp.where(first, a, b), at_lowest, at_section)

    def load(self, args: AbstractScene, y: PyTree) -> None:
        return None


class PushedLowestSwing(AbstractLowestSwing):
    """A walker that is pushed.

    Attributes:
        walker: that walker.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = (0, 1, 2, 3)
    walker: DisturbedCycle

    def lowered(self, args: AbstractWalkerScene, y: PyTree) -> Scalar:
        return jnp.zeros_like(y.push)


class SteppedLowestSwing(AbstractLowestSwing):
    """A walker that steps down.

    A compliant one's cycle has the footstep in its middle: by then the foot that stands is on the
    lower ground, and the one that swings has left the upper.

    Attributes:
        walker: that walker.
    """

    cyclic_coordinates: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4)
    walker: SteppedCycle

    def lowered(self, args: AbstractWalkerScene, y: PyTree) -> Scalar:
        if not args.compliant:
            return jnp.zeros_like(y.drop)
        return y.drop * args.walker.l


class LowestSwingSection(AbstractSection):
    """Behind the arrival `passed` tells which it was: the lowest place, or a walker's own section.

    Attributes:
        section: of the disturbed walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        motion = motion_of(y)
        rises = _swing_height_rate(args, motion_of(motion))
        return jnp.where(y.passed > 0.5, rises, self.section.value(args, motion))

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        motion = motion_of(y)
        swings = _swings(args, motion_of(motion))
        return jnp.where(y.passed > 0.5, swings, self.section.counts(args, motion))


def _swing_foot(args: AbstractScene, state: PyTree) -> Foot:
    """A compliant walker's, leg 2's: its cycle has the footstep before, and the exchange of legs
    behind."""
    return feet(cast("Scene", args), state).foot_2


def _swing_height(args: AbstractWalkerScene, state: PyTree) -> Scalar:
    """Of the foot that swings above its ground [m]; a rigid walker's is leg 1's."""
    if not args.compliant:
        return args.walker.hip_to_foot * (jnp.cos(state.theta_2) - jnp.cos(state.theta_1))
    return -_swing_foot(args, state).penetration


def _swing_height_rate(args: AbstractWalkerScene, state: PyTree) -> Scalar:
    if not args.compliant:
        by_1 = jnp.sin(state.theta_1) * state.omega_1
        return args.walker.hip_to_foot * (by_1 - jnp.sin(state.theta_2) * state.omega_2)
    return -_swing_foot(args, state).penetration_rate


def _swings(args: AbstractScene, state: PyTree) -> Scalar:
    """Whether the clearance rule lets that foot pass."""
    if not args.compliant:
        return jnp.asarray(True)
    return jnp.logical_not(jnp.asarray(_swing_foot(args, state).admitted))


def through_lowest_swing(walker: AbstractSystem) -> AbstractLowestSwing:
    """A disturbed walker followed through its foot's lowest place."""
    if isinstance(walker, SteppedCycle):
        return SteppedLowestSwing(walker)
    assert isinstance(walker, DisturbedCycle)
    return PushedLowestSwing(walker)
