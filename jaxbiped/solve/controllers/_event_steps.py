"""Events within a step: step-size controllers that deal with contacts, footsteps and endings.

All statements on contacts also hold for stops and their limits. A foot that is off the ground at
both ends of a step may touch it in between, and a foot that is barely in the ground at an end may
have been deeper. No error estimate sees this if no stage of the step feels the force:
`ShallowContact` ends the step just past the beginning of the contact instead.

At touchdown the force has a corner, because of which steps of any size that go far past it are
rejected. Reducing the size step by step would cost some ten attempts at every touchdown of the
seed's walker: `TouchdownAhead` lets the attempt after a rejected one end just past the touchdown.

Steps of one size are not shortened: `MissedContacts` counts those that step over a contact. A solve
ends at a footstep (`FootstepLimit`) or just past another ending (`LocatedEnding`). Its `args` must
be the scene.
"""

import functools
from collections.abc import Callable
from typing import Any, TypeAlias, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import RealScalarLike, Scalar, any_of
from jaxbiped.compiler import fusion_barrier
from jaxbiped.hybrid._guards import Gap
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.solve._step_polynomials import StepCubic
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractMemorylessControl,
    AbstractWrappedControl,
    Adapted,
    Attempt,
    try_again,
)

PATIENCE = 100.0
"""Time allowed for each footstep asked for [s]."""
_OVERSHOOT = 5e-5
"""Part of the way to the ground that a step ends past it."""
_PAST_ENDING = 1e-9
"""Part of the way to an ending that the last step may go past it."""
_MARGIN = 1e-12
"""Time, in the system's unit, that either does besides: on which side a step ends must be beyond
doubt."""
_BARELY = 1e-2
"""Depth and speed in the ground at a step's end, in units of height and speed at its beginning,
below which a contact is shallow."""
_BARELY_WHERE_KEPT = 0.1
"""That depth where the step would be kept."""
_ALL = 0.999
"""Part of a step that is as good as all of it."""
_REACH = 2.0
"""Way that a foot can sink or rise in a step, in units of the one at the speed it begins with."""
_LESS_PAST = 0.03
"""How far the next attempt goes past a touchdown, as a share of the rejected one's way."""
_LARGEST = 0.95
"""The next attempt, at most, as a share of the rejected one."""
_Gaps: TypeAlias = Callable[[PyTree], tuple[Gap, ...]]
"""The gaps of a system at a state."""


class ShallowContact(AbstractMemorylessControl):
    """Wraps a controller; a step in which a foot dips into the ground is retried up to there.

    Attributes:
        system: what moves; its gaps are watched.
    """

    system: AbstractSystem

    def adapt(self, attempt: Attempt) -> Adapted:
        adapted = attempt.by(self.controller)
        start, span = cast(Scalar, attempt.t0), cast(Scalar, attempt.t1 - attempt.t0)
        gaps = functools.partial(self.system.gaps, attempt.args)
        found = _touchdown(gaps, start, span, adapted.keep, attempt.y0, attempt.y1)
        again, target = jax.lax.stop_gradient(found)
        return try_again(attempt, adapted, again, target)


def _touchdown(
    gaps: _Gaps, t0: Scalar, span: Scalar, keep: Scalar, y0: PyTree, y1: PyTree
) -> tuple[Scalar, Scalar]:
    """Whether a step, which is to be kept or not, is to end at a contact instead, and when [s]."""
    part = jnp.ones_like(span)
    for k, before in enumerate(gaps(y0)):
        if before.admitted is False:
            continue
        near = jnp.abs(before.penetration) < _REACH * span * before.penetration_rate
        near = near if before.admitted is None else near & before.admitted
        above = functools.partial(_part_above, gaps, span, keep, k, before, y1)
        part = jnp.minimum(part, jnp.where(near, fusion_barrier(near, above), 1.0))
    target = t0 + span * part * (1.0 + _OVERSHOOT) + _MARGIN
    return (part < _ALL) & (target < t0 + span), target


def _part_above(gaps: _Gaps, span: Scalar, keep: Scalar, k: int, before: Gap, y1: PyTree) -> Scalar:
    """The part of a step after which a foot comes into the ground, barely; 1 if it does not.

    Or that after which it is lowest, where it may come into the ground. A step that is tried again
    to there ends in the air, or in the ground at no speed: then the contact has begun before. So it
    has where the foot is on its way out of the ground, and a damper's force is over by then. Or the
    part after which a foot is deepest that begins barely in the ground and ends out of it: a smooth
    force is not felt yet where the step begins. Of a step that is not kept the end tells nothing.
    """
    after = gaps(y1)[k]
    rates = span * before.penetration_rate, span * after.penetration_rate
    depth = StepCubic(before.penetration, after.penetration, *rates)
    off, rises = depth.start <= 0.0, keep & (depth.end_slope < 0.0)
    brief = ~off & (depth.start_slope > 0.0) & (depth.end <= 0.0) & rises
    if before.admitted is not None and after.admitted is not None:
        admitted = before.admitted & after.admitted
        off, brief = off & admitted, brief & admitted
    leaves = off & (depth.end <= 0.0) & depth.may_touch()
    slow = jnp.abs(depth.end_slope) < _BARELY * depth.start_slope
    barely = slow & (depth.end < -jnp.where(keep, _BARELY_WHERE_KEPT, _BARELY) * depth.start)
    stays = off & (depth.end > 0.0) & (barely | rises)
    lowest = jnp.where(leaves | brief, depth.turning_point(), 1.0)
    deepest = depth.at(lowest)
    contact = (leaves | stays) & (deepest > 0.0)

    def touchdown() -> Scalar:
        # The same cubic up to there, where it has a sign change to be found.
        slope_there = jnp.where(leaves, 0.0, depth.end_slope)
        down = StepCubic(depth.start, deepest, lowest * depth.start_slope, lowest * slope_there)
        return lowest * down.sign_change()

    return jnp.where(contact, fusion_barrier(contact, touchdown), lowest)


class TouchdownAhead(AbstractMemorylessControl):
    """Wraps a controller; the attempt after a rejected step may be longer than it proposes.

    Attributes:
        system: what moves; its gaps are watched.
    """

    system: AbstractSystem

    def adapt(self, attempt: Attempt) -> Adapted:
        adapted = attempt.by(self.controller)
        span = jnp.asarray(attempt.t1 - attempt.t0)
        gaps = self.system.gaps(attempt.args, attempt.y0)
        target = jnp.asarray(attempt.t0) + _to_touchdown(gaps, span)
        target = jax.lax.stop_gradient(jnp.maximum(adapted.t1, target))
        return adapted._replace(t1=jnp.where(adapted.keep, adapted.t1, target))


def _to_touchdown(gaps: tuple[Gap, ...], span: Scalar) -> Scalar:
    """Time to just past where the last foot comes down that does in `span` [s]; 0 if none does.

    At the speed that it has: where that falls short, once more the next time.
    """
    found = jnp.zeros_like(span)
    for gap in gaps:
        if gap.admitted is False:
            continue
        falls = (gap.penetration < 0.0) & (gap.penetration_rate > 0.0)
        if gap.admitted is not None:
            falls = falls & gap.admitted
        time = -gap.penetration / jnp.where(falls, gap.penetration_rate, 1.0)
        past = jnp.minimum(time + _LESS_PAST * (span - time), _LARGEST * span)
        found = jnp.maximum(found, jnp.where(falls & (time < span), past, 0.0))
    return found


class MissedContacts(AbstractWrappedControl):
    """Wraps a controller; its state carries the number of contacts between two steps.

    Attributes:
        system: what moves; its gaps are watched.
    """

    system: AbstractSystem

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        first, inner = self.controller.init(*request)
        return first, (inner, jnp.zeros((), dtype=jnp.int32))

    def adapt(self, attempt: Attempt) -> Adapted:
        inner, count = attempt.memory
        adapted = attempt.by(self.controller, memory=inner)
        span = jnp.asarray(attempt.t1 - attempt.t0)
        ends = (self.system.gaps(attempt.args, y) for y in (attempt.y0, attempt.y1))
        for before, after in zip(*ends, strict=True):
            missed = adapted.keep & _misses(span, before, after)
            count = count + jnp.where(missed, 1, 0).astype(count.dtype)
        return adapted._replace(memory=(adapted.memory, count))


def _misses(span: Scalar, before: Gap, after: Gap) -> Scalar | bool:
    """Whether a foot that is off the ground at both ends is in it in between (boolean).

    By the cubic through depths and rates at both ends.
    """
    if before.admitted is False:
        return False
    rates = span * before.penetration_rate, span * after.penetration_rate
    depth = StepCubic(before.penetration, after.penetration, *rates)
    off = (depth.start <= 0.0) & (depth.end <= 0.0) & (depth.start_slope > 0.0)
    if before.admitted is not None and after.admitted is not None:
        off = off & before.admitted & after.admitted
    return off & depth.turns() & (depth.at(depth.turning_point()) > 0.0)


class FootstepLimit(AbstractWrappedControl):
    """Wraps a controller; ends the solve at the end of the step with the last heel strike.

    Its state carries what cannot be computed from the walker's state: the leg that struck last, and
    the number of strikes.

    Attributes:
        limit: number of heel strikes after which the solve ends.
        system: what moves; its landings are counted.
    """

    limit: RealScalarLike
    system: AbstractSystem

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        first, inner = self.controller.init(*request)
        _, _, _, y0, _, args, *_ = request
        last = self.system.standing_leg(args, y0)
        return first, (inner, last, jnp.zeros_like(last))

    def adapt(self, attempt: Attempt) -> Adapted:
        inner, last, count = attempt.memory
        adapted = attempt.by(self.controller, memory=inner)
        lands = self.system.landings(attempt.args, attempt.y0, attempt.y1)
        # Of several legs another one made the strike before; a single leg hops.
        strikes = [
            adapted.keep & landed & (last != leg if len(lands) > 1 else True)
            for leg, landed in enumerate(lands, 1)
        ]
        for leg, strike in reversed(list(enumerate(strikes, 1))):
            last = jnp.where(strike, leg, last)
        count = count + jnp.where(any_of(strikes), 1, 0)
        successful = diffrax.RESULTS.successful
        done = diffrax.RESULTS.where(
            count >= self.limit, diffrax.RESULTS.event_occurred, successful
        )
        result = diffrax.RESULTS.where(adapted.result == successful, done, adapted.result)
        return adapted._replace(memory=(adapted.memory, last, count), result=result)


class LocatedEnding(AbstractMemorylessControl):
    """Wraps a controller; a step in which the solve ends is retried up to just past that point.

    The point is located with the secant of the ending's surface, in a few attempts. A step whose
    ends are not on opposite sides of the surface stays as it is. After the last footstep, the
    wrapped controller ends the solve.

    Attributes:
        system: what moves; its failures are watched.
        watch: failures that end the solve.
        probe: a state near the step's end at which failures are looked for first, if that costs
            less; None if there is no such state.
    """

    system: AbstractSystem
    watch: tuple[str, ...] = eqx.field(static=True)
    probe: PyTree = None

    def adapt(self, attempt: Attempt) -> Adapted:
        adapted = attempt.by(self.controller)
        scene, y1, t1 = attempt.args, attempt.y1, attempt.t1
        start, span = jnp.asarray(attempt.t0), jnp.asarray(t1 - attempt.t0)
        walked = jnp.asarray(adapted.result != diffrax.RESULTS.successful)
        probe = y1 if self.probe is None else self.probe
        failures = {
            name: happens
            for name, happens in self.system.failures(self.watch).items()
            if name != Ending.SOLVER_FAILED
        }
        ends = adapted.keep & walked
        for happens in failures.values():
            ends = ends | (adapted.keep & jnp.asarray(happens(t1, probe, scene)))

        def part_before() -> Scalar:
            code = jnp.asarray(int(Ending.WALKING))
            for name, happens in failures.items():
                code = jnp.where(happens(t1, y1, scene), int(name), code)
            surface = functools.partial(self.system.ending_surface, code, scene, y1)
            before, after = surface(attempt.y0), surface(y1)
            crossed = (before < 0.0) & (after > 0.0)
            crossed = crossed & (walked | (code != int(Ending.WALKING)))
            return jnp.where(crossed, before / jnp.where(crossed, before - after, 1.0), 1.0)

        way = span * jnp.where(ends, fusion_barrier(ends, part_before), 1.0)
        margin = _MARGIN * self.system.time_unit
        again = ends & (span - way > jnp.maximum(_PAST_ENDING * way, 4.0 * margin))
        target = start + way * (1.0 + 0.5 * _PAST_ENDING) + margin
        possible = (target > start) & (target < start + span)
        again, target = jax.lax.stop_gradient((again & possible, target))
        result = diffrax.RESULTS.where(again, diffrax.RESULTS.successful, adapted.result)
        return try_again(attempt, adapted, again, target)._replace(result=result)
