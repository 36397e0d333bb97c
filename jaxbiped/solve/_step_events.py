"""Step events: arrivals, endings and changes of mode within a step, and the ways onto them.

Each is located on the step's interpolant. An arrival is where its surface falls through zero while
it counts. Both are asked at the root: a leg that swings back fast has struck and is behind again by
the end of a step. A step that ends behind the surface of a change of mode is followed back to it by
Newton's method, as to an arrival.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar, select
from jaxbiped.hybrid._landing_system import LandingMotion, SurfaceCourse
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._explicit_step import DOPRI8, Rates, advance
from jaxbiped.solve._step_polynomials import Quintic, StepCubic

_RESOLVED = 1.0
"""Error that a surface may have, in units of rtol."""
EULER_DISTANCE = 0.1
"""Distance from a surface from which one Euler step leads onto it, in units of rtol; of √rtol
where its rate changes little by then: the square of what is left is far below the tolerance."""
_ON_SECTION = 1e-12
"""Value up to which a motion begins on the surface of arrivals: its rate tells on which side."""


class ModeEvents(NamedTuple):
    """What surfaces do within a step.

    Attributes:
        crosses: whether one is crossed (boolean).
        which: its number, the first one in time.
        place: the share of the step that lies before, roughly; 1 where none is.
        unclear: whether the step is too long to tell.
        grazes: whether one is touched by less than it is known to.
    """

    crosses: Scalar
    which: Scalar
    place: Scalar
    unclear: Scalar
    grazes: Scalar


def mode_events(
    step: Scalar,
    before: SurfaceCourse,
    after: SurfaceCourse,
    rtol: Scalar,
    length: Scalar,
    method: ExplicitMethod = DOPRI8,
) -> ModeEvents:
    """What happens within a step of one mode, from the surfaces at its ends.

    `step` is its length [s]; `length` counts it in units of the one whose error is the tolerance.
    """
    known = _RESOLVED * rtol
    begins_off = before.live & (before.values > known)
    leaves = before.live & (before.values > -known) & (before.rates > 0.0)
    crosses = (begins_off | leaves) & (after.values <= 0.0)
    # At rest on its surface its acceleration alone tells where it goes first.
    crosses = crosses | (before.live & (after.values <= -known))
    cubic = StepCubic(before.values, after.values, step * before.rates, step * after.rates)
    lowest = cubic.at(cubic.turning_point())
    touches = begins_off & ~crosses & cubic.may_touch()
    unclear, grazes = touches & (lowest < -known), touches & (jnp.abs(lowest) <= known)
    gaps = len(before.bends)
    if gaps:
        # Gaps are sums of angles, whose quintic bounds them.
        off = method.interpolation_error(rtol, length)
        ends = ((each.values[:gaps], each.rates[:gaps], each.bends) for each in (before, after))
        width = jnp.maximum(off, known)
        first, second, third, *others = Quintic.of(step, *ends).control
        # What rests on its surface leaves it by its acceleration.
        rests = ~begins_off[:gaps] & (jnp.abs(second) <= width)
        first, second = (jnp.where(rests, third, each) for each in (first, second))
        course = Quintic((first, second, third, *others))
        counts = [
            course.sign_changes(shift, from_second=~begins_off[:gaps]) for shift in (width, -width)
        ]
        live = before.live[:gaps]
        several = live & (jnp.minimum(*counts) > 1)
        perhaps = live & (jnp.maximum(*counts) > 1) & ~several
        unclear = jnp.concatenate([several | (perhaps & (off > known)), unclear[gaps:]])
        grazes = jnp.concatenate(
            [perhaps & (off <= known) & ~crosses[:gaps] & ~rests, grazes[gaps:]]
        )
    happens = jnp.any(crosses)

    def locate() -> tuple[Scalar, Scalar]:
        # What begins on its surface is followed from behind: there it may lie for a while.
        falls = after.rates < 0.0
        behind = 1.0 - after.values / jnp.where(falls, step * after.rates, 1.0)
        from_end = ~begins_off & falls
        places = jnp.where(from_end, jnp.clip(behind, 0.0, 1.0), cubic.sign_change())
        places = jnp.where(crosses, places, 1.0)
        which, first = jnp.zeros((), dtype=jnp.int64), places[0]
        for k in range(1, len(places)):
            which = jnp.where(places[k] < first, k, which)
            first = jnp.minimum(first, places[k])
        return which, first

    none = jnp.zeros((), dtype=jnp.int64), jnp.ones_like(step)
    which, place = jax.lax.cond(happens, locate, lambda: none)
    return ModeEvents(happens, which, place, jnp.any(unclear), jnp.any(grazes))


class OntoSurface(NamedTuple):
    """From a state onto a surface: whether one Euler step leads there, and its length [s]."""

    near: Scalar
    rest: Scalar


def onto_surface(at: SurfaceCourse, which: Scalar, rtol: Scalar, pace: Scalar) -> OntoSurface:
    """The way from a state to the surface of this number.

    `pace` is the length of a step whose error is about the tolerance [s].
    """
    straight = [jnp.zeros_like(pace)] * (len(at.values) - len(at.bends))
    every = zip(at.values, at.rates, [*at.bends, *straight], at.live, strict=True)
    value, rate, bend, live = next(every)
    known = jnp.asarray(len(at.bends) > 0)
    for k, each in enumerate(every, start=1):
        value, rate, bend, live, known = select(
            which == k, (*each, jnp.asarray(k < len(at.bends))), (value, rate, bend, live, known)
        )
    reachable = jnp.abs(value) <= EULER_DISTANCE * rtol
    # So slow that it lies on its surface as far as that is known.
    lies = reachable & (jnp.abs(rate) <= jnp.sqrt(rtol))
    rest = -value / jnp.where(rate == 0.0, 1.0, rate)
    turned = 0.5 * bend * rest * rest
    # Where it is known how a gap bends, one step leads onto it from farther away.
    root = jnp.sqrt(rtol)
    close = (
        known
        & (rate < 0.0)
        & (jnp.abs(value) <= EULER_DISTANCE * root)
        & (jnp.abs(rest) <= root * pace)
    )
    close = close & (jnp.abs(turned) <= 0.2 * EULER_DISTANCE * rtol)
    near = (reachable & (lies | (rate != 0.0))) | close
    rest = jnp.where(lies, 0.0, rest - turned / jnp.where(rate == 0.0, 1.0, rate))
    return OntoSurface(live & near, rest)


class StepEvents(NamedTuple):
    """What happens within a step; booleans, but for the place.

    Attributes:
        arrives, ends: whether the motion arrives, or comes to an ending.
        place: the share of the step that lies before, roughly.
        unclear: whether the step is too long to tell.
        above: whether it begins before an arrival, not beyond its surface.
        grazes: whether it depends on less than the surface is known to.
        changes: whether the mode changes, before anything else does.
    """

    arrives: Scalar
    ends: Scalar
    place: Scalar
    unclear: Scalar
    above: Scalar
    grazes: Scalar
    changes: Scalar | bool = False


def with_changes(happens: StepEvents, changes: ModeEvents) -> StepEvents:
    """With changes of the mode; what comes behind the first of them does not happen."""
    happens_at_all = happens.arrives | happens.ends
    first = changes.crosses & (~happens_at_all | (changes.place <= happens.place))
    return StepEvents(
        arrives=happens.arrives & ~first,
        ends=happens.ends & ~first,
        place=jnp.where(first, changes.place, happens.place),
        unclear=happens.unclear | changes.unclear,
        above=happens.above,
        grazes=happens.grazes & ~first,
        changes=first,
    )


def events_within(
    motion: LandingMotion,
    step: Scalar,
    before: tuple[Any, Rates],
    after: tuple[Any, Rates],
    *,
    rtol: Scalar,
    length: Scalar,
    begins_on_section: Scalar,
    endings: bool = True,
    method: ExplicitMethod = DOPRI8,
) -> StepEvents:
    """What happens within a step, from states at both ends and rates that end with accelerations.

    `step` is its length [s]; `length` counts it in units of the one whose error is the tolerance;
    `endings` tells whether endings are watched for.
    """

    system, args = motion

    def course(surface: Callable[[Any], Scalar]) -> Quintic:
        ends = (_along(motion, surface, *end) for end in (before, after))
        return Quintic.of(step, *ends)

    arrival = course(functools.partial(system.arrival_surface, args))
    counts = course(functools.partial(system.arrival_counts, args))
    ending = course(system.surface_of_ending(args, after[0]))
    outside = ending.control[-1] <= 0.0 if endings else jnp.zeros_like(begins_on_section)
    begins_on_section = begins_on_section | (jnp.abs(arrival.control[0]) <= _ON_SECTION)
    off, known = method.interpolation_error(rtol, length), _RESOLVED * rtol
    width = jnp.maximum(off, known)
    several, perhaps = _turns(arrival, width, begins_on_section)
    ends_and_returns, nearly_ends = (
        _turns(ending, width, jnp.zeros_like(outside)) if endings else (outside, outside)
    )
    above = jnp.where(begins_on_section, arrival.control[1], arrival.control[0]) > 0.0
    comes_down = above & (arrival.control[-1] <= 0.0)
    place = select(outside, ending, arrival).root()
    _, slope, curvature = arrival.derivatives(place)
    ahead, drift, _ = counts.derivatives(place)
    # So near to where it turns, or to where arrivals begin to count, that it may not arrive at all.
    barely = slope * slope <= 2.0 * width * jnp.abs(curvature)
    slope, drift = jnp.abs(slope), jnp.abs(drift)
    barely = barely | (slope * jnp.abs(ahead) <= width * (slope + drift))
    may_count = functools.reduce(jnp.maximum, counts.control) > -width
    open_ = may_count & ((perhaps & ~several) | (comes_down & barely & ~outside))
    open_ = open_ | (nearly_ends & ~ends_and_returns)
    unclear = may_count & (several | (comes_down & (begins_on_section | outside)))
    unclear = unclear | ends_and_returns | (open_ & (off > known))
    clear = ~unclear & ~open_
    return StepEvents(
        arrives=comes_down & clear & ~outside & (ahead > 0.0),
        ends=outside & ~unclear,
        place=place,
        unclear=unclear,
        above=above,
        grazes=open_ & ~unclear,
    )


class StepOnto(NamedTuple):
    """From a trial onto an arrival, or an ending where one is landed on.

    Attributes:
        near: whether one Euler step leads there.
        rest: its length [s], which may lie behind.
        state: there.
        closing: how fast the surface's value changes at the trial [1/s].
        counts: whether an arrival there counts.
    """

    near: Scalar
    rest: Scalar
    state: Any
    closing: Scalar
    counts: Scalar


def euler_step_onto(
    motion: LandingMotion, ends: Scalar, trial: Any, rates: Rates, rtol: Scalar
) -> StepOnto:
    """From a trial with these rates, roughly, onto an ending where it `ends`, else an arrival."""
    system, args = motion
    ending = system.surface_of_ending(args, trial)
    value, rate, curvature = select(
        ends,
        _along(motion, ending, trial, rates),
        _along(motion, functools.partial(system.arrival_surface, args), trial, rates),
    )
    rest = -value / jnp.where(rate == 0.0, 1.0, rate)
    near = jnp.abs(value) <= EULER_DISTANCE * jnp.sqrt(rtol)
    near = near & (rate < 0.0)
    near = near & (jnp.abs(curvature) * rest * rest <= 0.4 * EULER_DISTANCE * rtol)
    counts = functools.partial(system.arrival_counts, args)
    ahead, drift, _ = _along(motion, counts, trial, rates)
    there = advance(motion, trial, rest, [1.0], [rates])
    return StepOnto(near, rest, there, rate, ahead + rest * drift > 0.0)


def _along(
    motion: LandingMotion, surface: Callable[[Any], Scalar], state: Any, rates: Rates
) -> tuple[Scalar, Scalar, Scalar]:
    """A function of the positions in a motion: its value and its first two derivatives.

    `rates` end with the accelerations.
    """
    system, args = motion
    positions, velocities = system.coordinates(args, state)

    def at(positions: Any) -> Scalar:
        return surface(system.with_coordinates(args, state, (*positions, *velocities)))

    def course(positions: Any, velocities: Any) -> tuple[Scalar, Scalar]:
        return jax.jvp(at, (positions,), (velocities,))

    accelerations = rates[-len(positions) :]
    along = jax.jvp(course, (positions, velocities), (velocities, accelerations))
    (value, rate), (_, curvature) = along
    return value, rate, jnp.asarray(curvature)


def _turns(course: Quintic, width: Scalar, from_second: Scalar) -> tuple[Scalar, Scalar]:
    """Whether it changes sign more than once, and whether it may, being known to a width."""
    high = course.sign_changes(width, from_second=from_second)
    low = course.sign_changes(-width, from_second=from_second)
    return jnp.minimum(high, low) > 1, jnp.maximum(high, low) > 1
