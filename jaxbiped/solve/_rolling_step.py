"""Rolling step: single support of the rigid walker by an explicit method, usually of order 8.

Heel strikes and falls within it are located on its interpolant. A heel strike is where the opening
falls through zero while the swing foot is ahead. Both are asked at the root: a leg that swings back
fast has struck and is behind again by the end of a step. A step that ends behind the surface of a
change of mode is followed back to it by Newton's method, as to a heel strike.
"""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._joint_loads import of_all_bodies
from jaxbiped.dynamics._stance import angles_and_rates, of_stance
from jaxbiped.dynamics._stance_motion import rolling_field, rolling_rates
from jaxbiped.dynamics._surfaces import Surface, lead, lean, opening, surface_along, uprightness
from jaxbiped.hybrid._rigid_guards import mode_switches
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._step_polynomials import Quintic, StepCubic

DOPRI8 = ExplicitMethod()
Rates = tuple[Scalar, ...]
"""Rates of the angles and of their rates."""
_RESOLVED = 1.0
"""Error that an opening or another surface may have [rad], in units of rtol."""
EULER_DISTANCE = 0.1
"""Distance from a surface [rad] from which one Euler step leads onto it, in units of rtol; of √rtol
where its rate changes little by then: the square of what is left is far below the tolerance."""
_ON_SECTION = 1e-12
"""Opening [rad] up to which a walk begins on the section: its rate tells on which side it is."""


class SurfaceCourse(NamedTuple):
    """The surfaces of a mode at a state.

    Attributes:
        values, rates: of each, shape (k,), the rates in 1/s.
        live: whether it matters there (booleans), shape (k,).
        bends: second derivatives of the first h, the gaps of limits, shape (h,).
        turning: angular accelerations there [rad/s²].
    """

    values: Scalar
    rates: Scalar
    live: Scalar
    bends: Scalar
    turning: tuple[Scalar, ...] = ()


def course_of(scene: RigidScene, state: Any) -> SurfaceCourse:
    """The surfaces at a state, followed along its motion."""

    def values(y: Any) -> tuple[list[Scalar], list[Scalar]]:
        found = mode_switches(scene, y)
        return [each.value for each in found], [jnp.asarray(each.live) for each in found]

    mechanism = scene.mechanism
    rates = rolling_field(0.0, state, scene)
    value, slope, live = jax.jvp(values, (state,), (rates,), has_aux=True)
    _, moves = angles_and_rates(mechanism.structure, rates)
    turning = of_all_bodies(mechanism.structure, moves, rates[0])
    bends = [limit.gap.of(turning) for limit in rigid_modes(mechanism).limits]
    return SurfaceCourse(
        jnp.stack(value),
        jnp.stack(slope),
        jnp.stack(live),
        jnp.stack(bends) if bends else jnp.zeros(0, value[0].dtype),
        moves,
    )


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


def rolling_step(
    scene: RigidScene,
    state: Any,
    at_start: tuple[Scalar, ...],
    step: Scalar,
    rtol: Scalar,
    *,
    method: ExplicitMethod = DOPRI8,
) -> tuple[Any, Scalar, list[Rates]]:
    """The state a step further, its error in units of the tolerance, and the rates of its stages.

    Those of the last stage are the state's, roughly.

    `at_start` are the angular accelerations at the start. The place along the slope stays. Of the
    error, the root mean square over the components; infinite where it is no number.
    """
    count, tableau = len(at_start), method.tableau
    turning = slice(1 + count, 1 + 2 * count)
    found = jnp.stack([*state[turning], *at_start])
    found = jnp.pad(found[None], ((0, len(tableau.stages)), (0, 0)))

    def stage(found: Scalar, each: Any) -> tuple[Scalar, None]:
        row, here = each
        at = advance(state, step, list(row), [tuple(rates) for rates in found])
        rates = jnp.stack([*at[turning], *rolling_rates(scene, at)])
        return jnp.where(here[:, None], rates, found), None

    # A loop, which XLA compiles once; lanes write it out, without what is multiplied by zero.
    here = np.eye(len(tableau.stages) + 1, dtype=bool)[1:]
    found, _ = jax.lax.scan(stage, found, (tableau.stages.astype(found.dtype), here))
    stages: list[Rates] = [tuple(row) for row in found]
    end = advance(state, step, tableau.end, stages)
    share = jnp.zeros_like(step)
    ends = list(zip(state[1 : 1 + 2 * count], end[1 : 1 + 2 * count], strict=True))
    for i, (a, b) in enumerate(ends if method.estimates else []):
        error = step * _weighted(tableau.error, stages, i)
        size = rtol * (0.01 + jnp.maximum(jnp.abs(a), jnp.abs(b)))
        share = share + (error / size) ** 2
    # A method without an estimate errs by one tolerance, as far as is known.
    error = jnp.sqrt(share / len(ends)) if method.estimates else 1.0 + 0.0 * sum(end)
    return end, jnp.where(jnp.isnan(error), jnp.inf, error), stages


def within_step(
    step: Scalar, place: Scalar, before: tuple[Any, Rates], after: tuple[Any, Rates]
) -> Any:
    """The state at a share of a step, from states and accelerations at both ends: of order five."""
    start, end, bends = before[0], after[0], (before[1], after[1])
    count = len(bends[0])
    angles, rates = [], []
    for i in range(count):
        ends = [
            (state[1 + i], state[1 + count + i], bend[i])
            for state, bend in zip((start, end), bends, strict=True)
        ]
        angle, slope, _ = Quintic.of(step, *ends).derivatives(place)
        angles.append(angle)
        rates.append(slope / jnp.where(step == 0.0, 1.0, step))
    return type(start)(start[0], *angles, *rates, *start[1 + 2 * count :])


def advance(
    state: Any, step: Scalar, weights: Sequence[Any] | np.ndarray, stages: list[Rates]
) -> Any:
    """The state a step further, at weighted rates of its angles and of their rates."""
    count = len(stages[0])
    new = (state[1 + i] + step * _weighted(weights, stages, i) for i in range(count))
    return type(state)(state[0], *new, *state[1 + count :])


def _weighted(weights: Sequence[Any] | np.ndarray, stages: list[Rates], i: int) -> Scalar:
    pairs = zip(weights, stages, strict=True)
    terms = [
        (weight if isinstance(weight, jax.Array) else float(weight)) * stage[i]
        for weight, stage in pairs
        if isinstance(weight, jax.Array) or weight != 0.0
    ]
    return functools.reduce(operator.add, terms)


def told_state(scene: RigidScene, state: Any) -> Any:
    """A state with the root point's place instead of the standing foot's."""
    return shifted(state, root_place(scene, state))


def root_place(scene: RigidScene, state: Any) -> Scalar:
    """Where the root point is from the place of the standing foot at its body's angle 0 [m]."""
    return of_stance(scene, state, lambda stance: stance.root.x)


def state_after(
    scene: RigidScene,
    state: Any,
    accelerations: Rates,
    time: Scalar,
    method: ExplicitMethod = DOPRI8,
) -> Any:
    """The told state so much later [s], by one step from a state and its accelerations."""
    # The tolerance scales the step's error, which is not asked.
    end, *_ = rolling_step(scene, state, accelerations, time, jnp.ones_like(time), method=method)
    return told_state(scene, end)


def shifted(state: Any, distance: Scalar) -> Any:
    """A state farther down the slope [m]."""
    return type(state)(state[0] + distance, *state[1:])


class StepEvents(NamedTuple):
    """What happens within a step; booleans, but for the place.

    Attributes:
        strikes, falls: whether the swing foot comes down, or the stance leg too far.
        place: the share of the step that lies before, roughly.
        unclear: whether the step is too long to tell.
        above: whether it begins before a strike, not under the ground.
        grazes: whether it depends on less than the opening is known to.
        changes: whether the mode changes, before anything else does.
    """

    strikes: Scalar
    falls: Scalar
    place: Scalar
    unclear: Scalar
    above: Scalar
    grazes: Scalar
    changes: Scalar | bool = False


def with_changes(happens: StepEvents, changes: ModeEvents) -> StepEvents:
    """With changes of the mode; what comes behind the first of them does not happen."""
    happens_at_all = happens.strikes | happens.falls
    first = changes.crosses & (~happens_at_all | (changes.place <= happens.place))
    return StepEvents(
        strikes=happens.strikes & ~first,
        falls=happens.falls & ~first,
        place=jnp.where(first, changes.place, happens.place),
        unclear=happens.unclear | changes.unclear,
        above=happens.above,
        grazes=happens.grazes & ~first,
        changes=first,
    )


def events_within(
    scene: RigidScene,
    step: Scalar,
    before: tuple[Any, tuple[Scalar, ...]],
    after: tuple[Any, Rates],
    *,
    rtol: Scalar,
    length: Scalar,
    begins_on_section: Scalar,
    falls: bool = True,
    method: ExplicitMethod = DOPRI8,
) -> StepEvents:
    """What happens within a step, from states at both ends and rates that end with accelerations.

    `step` is its length [s]; `length` counts it in units of the one whose error is the tolerance;
    `falls` tells whether falls are watched for.
    """

    def course(function: Callable[[RigidScene, Any], Scalar]) -> Quintic:
        return Quintic.of(step, _along(scene, function, *before), _along(scene, function, *after))

    foot, front = course(opening), course(lead)
    side = jnp.sign(lean(scene, after[0]))
    upright = course(functools.partial(uprightness, side=side))
    outside = upright.control[-1] <= 0.0 if falls else jnp.zeros_like(begins_on_section)
    begins_on_section = begins_on_section | (jnp.abs(foot.control[0]) <= _ON_SECTION)
    off, known = method.interpolation_error(rtol, length), _RESOLVED * rtol
    width = jnp.maximum(off, known)
    several, perhaps = _turns(foot, width, begins_on_section)
    falls_and_rises, tilts = (
        _turns(upright, width, jnp.zeros_like(outside)) if falls else (outside, outside)
    )
    above = jnp.where(begins_on_section, foot.control[1], foot.control[0]) > 0.0
    comes_down = above & (foot.control[-1] <= 0.0)
    place = select(outside, upright, foot).root()
    _, slope, curvature = foot.derivatives(place)
    ahead, drift, _ = front.derivatives(place)
    # So near to where it turns, or to both legs in line, that it may not come down at all.
    barely = slope * slope <= 2.0 * width * jnp.abs(curvature)
    slope, drift = jnp.abs(slope), jnp.abs(drift)
    barely = barely | (slope * jnp.abs(ahead) <= width * (slope + drift))
    leads = functools.reduce(jnp.maximum, front.control) > -width
    open_ = leads & ((perhaps & ~several) | (comes_down & barely & ~outside))
    open_ = open_ | (tilts & ~falls_and_rises)
    unclear = leads & (several | (comes_down & (begins_on_section | outside)))
    unclear = unclear | falls_and_rises | (open_ & (off > known))
    clear = ~unclear & ~open_
    return StepEvents(
        strikes=comes_down & clear & ~outside & (ahead > 0.0),
        falls=outside & ~unclear,
        place=place,
        unclear=unclear,
        above=above,
        grazes=open_ & ~unclear,
    )


class StepOnto(NamedTuple):
    """From a trial onto a heel strike, or a fall where one is landed on.

    Attributes:
        near: whether one Euler step leads there.
        rest: its length [s], which may lie behind.
        state: there.
        closing: how fast what is landed on changes at the trial [rad/s].
        ahead: whether the swing foot is ahead there.
    """

    near: Scalar
    rest: Scalar
    state: Any
    closing: Scalar
    ahead: Scalar


def euler_step_onto(
    scene: RigidScene, falling: Scalar, trial: Any, rates: Rates, rtol: Scalar
) -> StepOnto:
    """From a trial with these rates, roughly, onto a fall where it is `falling`, else a strike."""
    fall = functools.partial(uprightness, side=jnp.sign(lean(scene, trial)))
    surface = select(
        falling, _along(scene, fall, trial, rates), _along(scene, opening, trial, rates)
    )
    rest = -surface.value / jnp.where(surface.rate == 0.0, 1.0, surface.rate)
    near = jnp.abs(surface.value) <= EULER_DISTANCE * jnp.sqrt(rtol)
    near = near & (surface.rate < 0.0)
    near = near & (jnp.abs(surface.curvature) * rest * rest <= 0.4 * EULER_DISTANCE * rtol)
    front = _along(scene, lead, trial, rates)
    there = advance(trial, rest, [1.0], [rates])
    return StepOnto(near, rest, there, surface.rate, front.value + rest * front.rate > 0.0)


def _along(
    scene: RigidScene, function: Callable[..., Scalar], state: Any, rates: Sequence[Scalar]
) -> Surface:
    """A function of scene and state in a motion whose rates end with the accelerations."""
    count = len(scene.mechanism.structure.free)
    return surface_along(functools.partial(function, scene), state, tuple(rates[-count:]))


def _turns(course: Quintic, width: Scalar, from_second: Scalar) -> tuple[Scalar, Scalar]:
    """Whether it changes sign more than once, and whether it may, being known to a width."""
    high = course.sign_changes(width, from_second=from_second)
    low = course.sign_changes(-width, from_second=from_second)
    return jnp.minimum(high, low) > 1, jnp.maximum(high, low) > 1
