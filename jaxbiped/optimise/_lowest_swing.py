"""Cycle through the swing foot's lowest place, behind which its height is a coordinate.

Each footstep has two arrivals: the lowest place, then the section. At the first a coordinate gains
the height, so that the response of clearance is a row of the return map's Jacobian, and the
response's derivatives a second variation.
"""

from typing import cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, select
from jaxbiped.dynamics._contacts import Foot, feet
from jaxbiped.dynamics._section import AbstractSection
from jaxbiped.dynamics._switches import Switch
from jaxbiped.optimise._augmented_cycles import (
    DROP,
    AbstractAugmented,
    DisturbedCycle,
    joined,
    motion_of,
)
from jaxbiped.scene._scene import AbstractWalkerScene, Scene


class LowestSwing(AbstractAugmented):
    """A disturbed walker whose `clearance`, in leg lengths, is told at its foot's lowest place.

    `passed` is 1 from there to the section, else 0. Clearances of several footsteps add up, as
    their lengths do. A compliant walker's cycle has the footstep in its middle: by the lowest place
    the foot that stands is on the lower ground, and the one that swings has left the upper.

    Attributes:
        walker: the disturbed walker.
    """

    walker: DisturbedCycle
    coordinates: tuple[str, ...] = eqx.field(static=True, default=("clearance", "passed"))

    def vector_field(self, t: Time, y: PyTree, args: AbstractWalkerScene) -> PyTree:
        zero = jnp.zeros_like(y.passed)
        rates = self.walker.vector_field(t, motion_of(y), args)
        return joined(y, rates, dict.fromkeys(self.coordinates, zero))

    def switches(self, args: AbstractWalkerScene, y: PyTree) -> tuple[Switch, ...]:
        return self.walker.switches(args, motion_of(y))

    def ending(self, args: AbstractWalkerScene, y: PyTree) -> Scalar:
        return self.walker.ending(args, motion_of(y))

    def reset_map(self, args: AbstractWalkerScene, y: PyTree) -> PyTree:
        motion, zero = motion_of(y), jnp.zeros_like(y.passed)
        lowered = zero
        if self.walker.disturbance == DROP and args.compliant:
            lowered = y.drop * args.walker.l
        height = _swing_height(args, motion_of(motion)) + lowered
        told = {"clearance": y.clearance + height / args.walker.l, "passed": y.passed + 1.0}
        after = self.walker.reset_map(args, motion)
        at_section = joined(y, after, {"clearance": y.clearance, "passed": zero})
        return select(y.passed < 0.5, joined(y, motion, told), at_section)

    def load(self, args: AbstractWalkerScene, y: PyTree) -> None:
        return None


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


def _swing_foot(args: AbstractWalkerScene, state: PyTree) -> Foot:
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


def _swings(args: AbstractWalkerScene, state: PyTree) -> Scalar:
    """Whether the clearance rule lets that foot pass."""
    if not args.compliant:
        return jnp.asarray(True)
    return jnp.logical_not(jnp.asarray(_swing_foot(args, state).admitted))
