"""Augmented cycles: cycles disturbed by a further coordinate, and where a swing foot is lowest.

A disturbance rests during the cycle and is zero behind it, so that the response to it is a column
of the return map's Jacobian, and the response's derivatives a second variation: a push along the
slope for one cycle, or ground on which the next footstep comes down lower. Behind that step heights
are those above the lower ground.
"""

import dataclasses
from typing import ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time, select
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._equivalent_states import exchange_legs
from jaxbiped.dynamics._surfaces import AbstractSection, clearance, clearance_rate, distance_ahead
from jaxbiped.optimise._augmented_system import (
    AbstractAugmentedSystem,
    MotionSection,
    join,
    motion_of,
)
from jaxbiped.scene._ground import Ground, SteppedGround
from jaxbiped.scene._scene import AbstractWalkerScene, RigidScene, Scene, is_rigid
from jaxbiped.variational._hybrid_system import AbstractSystem

_APART = 1e-2
"""How far ahead a rigid walker's foot is that can come down, as a share of the walker's height."""
PUSH, DROP = "push", "drop"


class DisturbedCycle(AbstractAugmentedSystem):
    """A walker that is pushed for one cycle, or whose swing leg comes down on lower ground.

    `push` is in units of the weight, which leans downhill by it, and with it the vertical that
    parts at joints refer to; `drop` in the walker's height, a leg length. Behind the arrival `drop`
    is zero and its value is `fallen`: the root point is that much higher above the ground. By then
    the leg behind has left the upper ground.

    Attributes:
        walker: the walker, undisturbed.
        coordinates: a clock, and what the disturbance needs.
        disturbance: "push" or "drop".
    """

    walker: AbstractSystem
    coordinates: tuple[str, ...] = eqx.field(static=True)
    disturbance: str = eqx.field(static=True)
    recurring: ClassVar[int] = 1

    def vector_field(self, t: Time, y: PyTree, args: AbstractWalkerScene) -> PyTree:
        rates = self.walker.vector_field(t, motion_of(y), self.scene_of(args, y))
        zero = jnp.zeros_like(y.clock)
        return join(y, rates, dict.fromkeys(self.coordinates, zero) | {"clock": zero + 1.0})

    def reset_map(self, args: AbstractWalkerScene, y: PyTree) -> PyTree:
        after = self.walker.reset_map(args, motion_of(y))
        told = {"clock": y.clock, self.disturbance: jnp.zeros_like(y.clock)}
        if self.disturbance == DROP:
            told["fallen"] = y.drop
            if args.compliant:
                height = args.mechanism.structure.coordinates[1]
                raised = getattr(after, height) + y.drop * args.mechanism.height
                after = after._replace(**{height: raised})
        return join(y, after, told)

    def scene_of(self, args: AbstractWalkerScene, y: PyTree) -> AbstractWalkerScene:
        """The scene as it is disturbed; the step of a rigid walker is its section's."""
        ground: Ground | SteppedGround
        if self.disturbance == PUSH:
            ground = dataclasses.replace(args.ground, slope=args.ground.slope + y.push)
        elif args.compliant:
            depth, leg = y.drop * args.mechanism.height, args.mechanism.structure.swing_leg
            ground = SteppedGround(args.ground.slope, args.ground.g, depth, leg)
        else:
            return args
        found: AbstractWalkerScene = eqx.tree_at(lambda each: each.ground, args, ground)
        return found


def disturbed_cycle(walker: AbstractSystem, disturbance: str) -> DisturbedCycle:
    more = (PUSH,) if disturbance == PUSH else ("fallen", DROP)
    return DisturbedCycle(walker, ("clock", *more), disturbance)


class SteppedSection(AbstractSection):
    """The walker's own section; a rigid walker's foot comes down where the ground now is.

    Attributes:
        section: of the walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        if not is_rigid(args):
            return MotionSection(self.section).value(args, y)
        before, unit = exchange_legs(args, motion_of(y)), args.mechanism.height
        # In units of the feet's distance: the height itself is flat where the legs pass.
        apart = jnp.maximum(distance_ahead(args, before), _APART * unit)
        return -2.0 * (clearance(args, before) + y.fallen * unit) / apart

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        return MotionSection(self.section).counts(args, y)


class LowestSwing(AbstractAugmentedSystem):
    """A disturbed walker whose `clearance`, in its heights, is told at its foot's lowest place.

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
        return join(y, rates, dict.fromkeys(self.coordinates, zero))

    def reset_map(self, args: AbstractWalkerScene, y: PyTree) -> PyTree:
        motion, zero = motion_of(y), jnp.zeros_like(y.passed)
        lowered = zero
        if self.walker.disturbance == DROP and args.compliant:
            lowered = y.drop * args.mechanism.height
        height = _swing_foot(args, motion_of(motion)).height + lowered
        told = {"clearance": y.clearance + height / args.mechanism.height, "passed": y.passed + 1.0}
        after = self.walker.reset_map(args, motion)
        at_section = join(y, after, {"clearance": y.clearance, "passed": zero})
        return select(y.passed < 0.5, join(y, motion, told), at_section)


class LowestSwingSection(AbstractSection):
    """Behind the arrival `passed` tells which it was: the lowest place, or a walker's own section.

    Attributes:
        section: of the disturbed walker.
    """

    section: AbstractSection

    def value(self, args: PyTree, y: PyTree) -> Scalar:
        motion = motion_of(y)
        rises = _swing_foot(args, motion_of(motion)).rate
        return jnp.where(y.passed > 0.5, rises, self.section.value(args, motion))

    def counts(self, args: PyTree, y: PyTree) -> Scalar:
        motion = motion_of(y)
        swings = _swing_foot(args, motion_of(motion)).swings
        return jnp.where(y.passed > 0.5, swings, self.section.counts(args, motion))


class _SwingFoot(NamedTuple):
    """Height above its ground [m], its rate, and whether the clearance rule lets it pass."""

    height: Scalar
    rate: Scalar
    swings: Scalar


def _swing_foot(args: AbstractWalkerScene, state: PyTree) -> _SwingFoot:
    """A compliant walker's stance leg's, the lower one of several: its cycle has the footstep
    before, and the exchange of legs behind."""
    if not args.compliant:
        rigid = cast("RigidScene", args)
        return _SwingFoot(clearance(rigid, state), clearance_rate(rigid, state), jnp.asarray(True))
    structure, found = args.mechanism.structure, feet(cast("Scene", args), state)
    lowest, *others = (found[k] for k in structure.feet_of_leg[structure.stance_leg])
    for foot in others:
        lowest = select(foot.penetration > lowest.penetration, foot, lowest)
    swings = jnp.logical_not(jnp.asarray(lowest.admitted))
    return _SwingFoot(-lowest.penetration, -lowest.penetration_rate, swings)
