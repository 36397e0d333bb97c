"""Landing steps: explicit steps of a landing system, followed back onto events that they pass."""

import enum
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, select
from jaxbiped.hybrid._landing_system import AbstractLandingSystem, LandingMotion, SurfaceCourse
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._explicit_step import DOPRI8, Rates, advance, explicit_step
from jaxbiped.solve._step_events import (
    EULER_DISTANCE,
    ModeEvents,
    StepOnto,
    euler_step_onto,
    events_within,
    mode_events,
    onto_surface,
    with_changes,
)

_FIRST_STEP = 0.03
"""First step, in the system's scale of time."""
_STRETCH = 1.15
"""By how much a step may be longer than chosen to end where an arrival is due."""


class Landing(NamedTuple):
    """One simulation's inputs; every leaf a floating-point number.

    Attributes:
        system, scene, state: what moves, its parameters, and from where.
        duration: simulated time [s].
        footsteps: arrivals after which to end, 0 for no limit.
        rtol: relative tolerance; the absolute one (SI) is a hundredth of it.
        max_attempts: cap on the attempted steps.
        recording: inputs of who looks at the steps, if it has any.
        dt: length of all steps [s]; None: each is as long as its error allows.
    """

    system: AbstractLandingSystem
    scene: PyTree
    state: Any
    duration: Scalar
    footsteps: Scalar
    rtol: Scalar
    max_attempts: Scalar
    recording: Any = None
    dt: Scalar | None = None

    @property
    def motion(self) -> LandingMotion:
        """What moves, with its parameters."""
        return LandingMotion(self.system, self.scene)


class LandingProgress(NamedTuple):
    """What is carried from one attempted step to the next.

    Attributes:
        t, state: so far; the state as the system has it carried.
        accelerations: of the positions there.
        step: to attempt next [s]; negative while an arrival or an ending is landed on from beyond.
        pace: the last free step, with which the next footstep begins.
        arrival, period: time of the last arrival, and since the one before it [s].
        due: when the next one is expected [s]; infinite while footsteps differ in their periods.
        landing: number of Newton steps onto an arrival or an ending, 0 in free motion.
        ending: whether that is an ending.
        arrived: whether the last attempt ended by an arrival.
        footsteps: how many so far.
        grazes: steps so far of which the tolerance does not tell whether the motion arrived.
        pulls: steps so far behind which the load was below zero, where they are counted.
        accepted, rejected: attempted steps so far, by what became of them.
        code: of the `Ending` that came, 0 for none.
        modes: what is known of mode changes; None where only one mode can occur.
    """

    t: Scalar
    state: Any
    accelerations: tuple[Scalar, ...]
    step: Scalar
    pace: Scalar
    arrival: Scalar
    period: Scalar
    due: Scalar
    landing: Scalar
    ending: Scalar
    arrived: Scalar
    footsteps: Scalar
    grazes: Scalar
    pulls: Scalar
    accepted: Scalar
    rejected: Scalar
    code: Scalar
    modes: "ModeProgress | None" = None


class ModeProgress(NamedTuple):
    """What is carried of mode changes.

    Attributes:
        course: the surfaces at the state.
        changing: number of the one that the next step leads onto, counted from one; 0 for none.
        changed: whether the last attempt ended by a change of mode.
        begin: the first mode.
        times: when each was last changed at [s].
        paces: first steps behind an arrival, then behind each change [s]; 0 where unknown.
        behind: number of the one of these that the next step begins from, counted from one; 0 for
            none.
    """

    course: SurfaceCourse
    changing: Scalar
    changed: Scalar
    begin: Scalar
    times: Scalar
    paces: Scalar
    behind: Scalar


def initial_progress(solve: Landing) -> LandingProgress:
    """Before the first step."""
    (system, args), state = solve.motion, solve.state
    zero = jnp.zeros_like(solve.duration)
    none = jnp.zeros((), dtype=jnp.int64)
    step = solve.dt
    if step is None:
        step = _FIRST_STEP * system.time_scale(args)
    step = jnp.minimum(step, solve.duration)
    no = jnp.asarray(False)
    modes = None
    if system.changes_mode(args):
        state = system.change_mode(args, state)
        course = system.course(args, state)
        paces = jnp.zeros(1 + len(course.values), zero.dtype)
        times = jnp.full_like(paces[1:], -jnp.inf)
        modes = ModeProgress(course, none, no, state.mode, times, paces, none)
        accelerations = course.accelerations
    else:
        accelerations = system.accelerations(args, state)
    never = jnp.full_like(zero, jnp.inf)
    return LandingProgress(
        t=zero,
        state=system.carried(args, state),
        accelerations=accelerations,
        step=step,
        pace=step,
        arrival=zero,
        period=never,
        due=never,
        landing=none,
        ending=no,
        arrived=no,
        footsteps=none,
        grazes=none,
        pulls=none,
        accepted=none,
        rejected=none,
        code=none,
        modes=modes,
    )


def with_next_step(solve: Landing, after: LandingProgress) -> LandingProgress:
    """With its step, unless it lands: the pace, or what ends it where an event or the end is due.

    Where footsteps last alike a mode changes as long behind an arrival as it did in the last one.
    """
    left, modes = after.due - after.t, after.modes
    changing, least = jnp.zeros_like(after.landing), 1e-6 * after.period
    if modes is not None:
        steady = after.due < jnp.inf
        for k, time in enumerate(modes.times, start=1):
            waits = time + after.period - after.t
            first = steady & (waits > least) & (waits < left)
            left, changing = select(first, (waits, jnp.full_like(changing, k)), (left, changing))
    hits = (left > least) & (left <= _STRETCH * after.pace)
    step = jnp.minimum(jnp.where(hits, left, after.pace), solve.duration - after.t)
    lands = after.landing > 0
    if modes is not None:
        changing = jnp.where(lands, modes.changing, jnp.where(hits, changing, 0))
        modes = modes._replace(changing=changing)
    return after._replace(step=jnp.where(lands, after.step, step), modes=modes)


_SAFETY, _MOST_SHRINK, _MOST_GROWTH = 0.8, 0.2, 5.0
_ROUNDING = 1e-14
"""Shortest step, as a share of the time."""
_MOST_LANDINGS = 12
"""Newton steps onto an arrival or an ending, after which it counts as missed."""


class Attempted(NamedTuple):
    """An attempted step.

    Attributes:
        after: what is then carried.
        over: whether the solve is over (boolean).
        accepted: whether the step was accepted.
        end: gives the state at its end, before what a reset makes of it.
        stages: rates of its stages.
        trial: where these lead.
    """

    after: LandingProgress
    over: Scalar
    accepted: Scalar
    end: Callable[[], Any]
    stages: list[Rates]
    trial: Any


class EndingWatch(enum.Enum):
    """What becomes of endings."""

    LOCATED = enum.auto()
    """They are landed on."""
    INTERPOLATED = enum.auto()
    """Their time is interpolated, with no accurate state: it saves a step."""
    IGNORED = enum.auto()
    """The motion goes on."""


def attempt_step(
    solve: Landing,
    now: LandingProgress,
    *,
    method: ExplicitMethod = DOPRI8,
    endings: EndingWatch = EndingWatch.LOCATED,
) -> Attempted:
    """One attempted step further."""
    motion = system, args = solve.motion
    trial, error, stages = explicit_step(
        motion, now.state, now.accelerations, now.step, solve.rtol, method=method
    )
    roughly = stages[-1]
    onto = euler_step_onto(motion, now.ending, trial, roughly, solve.rtol)
    length = method.length(error)
    course = changes = None
    if now.modes is not None:
        course = system.course(args, trial)
        changes = mode_events(now.step, now.modes.course, course, solve.rtol, length, method)
        surface = onto_surface(course, now.modes.changing - 1, solve.rtol, now.pace)
        there = _along_course(motion, trial, course, surface.rest)
        change = onto._replace(near=surface.near, rest=surface.rest, state=there)
        onto = select(now.modes.changing > 0, change, onto)
    free, kept = _after_free_step(
        solve, now, trial, error, length, method, roughly, onto, endings, changes
    )
    landing = now.landing > 0
    after = select(landing, _landing(solve, now, trial, onto), free)
    if now.modes is None:
        reset = _after_reset(solve, onto)
    else:  # with stops an impact is much work
        reset = jax.lax.cond(after.arrived, lambda: _after_reset(solve, onto), lambda: onto.state)
    tried = after

    def end() -> Any:
        state = select(tried.arrived, onto.state, tried.state)
        return state if tried.modes is None else select(tried.modes.changed, onto.state, state)

    accepted = landing | kept
    after = select(after.arrived, _after_arrival(solve, after, onto, reset), after)
    # The last stage is the first one of the next step, behind a reset from the new state.
    if now.modes is None:
        accelerations = system.accelerations(args, select(after.arrived, reset, trial))
        accelerations = select(accepted, accelerations, now.accelerations)
    else:
        here = select(accepted, course, now.modes.course)
        after = _after_change(solve, after, onto, here)
        assert after.modes is not None
        accelerations = after.modes.course.accelerations
    one = jnp.where(accepted, 1, 0)
    after = after._replace(
        accelerations=accelerations,
        accepted=now.accepted + one,
        rejected=now.rejected + (1 - one),
    )
    after = with_next_step(solve, after)
    enough = (solve.footsteps > 0.0) & (after.footsteps.astype(after.t.dtype) >= solve.footsteps)
    done = enough | ((after.landing == 0) & (after.t >= solve.duration))
    attempts = (after.accepted + after.rejected).astype(after.t.dtype)
    tired = attempts >= solve.max_attempts
    code = jnp.where((after.code == 0) & tired & ~done, int(Ending.OUT_OF_STEPS), after.code)
    return Attempted(after._replace(code=code), done | (code != 0), accepted, end, stages, trial)


def ending_of(solve: Landing, now: LandingProgress, waits: Scalar) -> Scalar:
    """Code of the `Ending`; `waits`: whether the duration only bounds the wait for footsteps."""
    few = now.footsteps.astype(now.t.dtype) < solve.footsteps
    late = (now.code == 0) & few & waits
    return jnp.where(late, int(Ending.TIMED_OUT), now.code)


def _after_reset(solve: Landing, onto: StepOnto) -> Any:
    """The state behind an arrival."""
    system, args = solve.motion
    return system.in_place(args, onto.state, system.reset_map(args, onto.state))


def _after_change(
    solve: Landing, trial: LandingProgress, onto: StepOnto, course: Any
) -> LandingProgress:
    """After the change of mode beside a trial; with its surfaces, wherever the motion is now."""
    assert trial.modes is not None
    (system, args), changed = solve.motion, trial.modes.changed
    state = jax.lax.cond(
        changed,
        lambda: system.change_mode(args, onto.state, solve.rtol),
        lambda: trial.state,
    )
    state = system.in_place(args, onto.state, state, changed)
    t = jnp.where(changed, trial.t + onto.rest, trial.t)
    event = jnp.where(trial.arrived, 1, jnp.where(changed, 1 + trial.modes.changing, 0))
    happened = jnp.arange(1, 1 + len(trial.modes.paces)) == event
    known = jnp.sum(jnp.where(happened, trial.modes.paces, 0.0))
    modes = trial.modes._replace(
        course=jax.lax.cond(
            trial.arrived | changed, lambda: system.course(args, state), lambda: course
        ),
        changing=jnp.where(changed, 0, trial.modes.changing),
        times=jnp.where(happened[1:], t, trial.modes.times),
        behind=jnp.where(event > 0, event, trial.modes.behind),
    )
    return trial._replace(
        t=t,
        state=state,
        pace=jnp.where(known > 0.0, known, trial.pace) if solve.dt is None else trial.pace,
        landing=jnp.where(changed, 0, trial.landing),
        modes=modes,
    )


def _after_arrival(
    solve: Landing, trial: LandingProgress, onto: StepOnto, state: Any
) -> LandingProgress:
    """After the arrival beside a trial. Where footsteps last alike, the next one is known."""
    t = trial.t + onto.rest
    period = t - trial.arrival
    change_of_rest = jnp.abs(period - trial.period) * jnp.abs(onto.closing)
    steady = change_of_rest <= 2.0 * EULER_DISTANCE * jnp.sqrt(solve.rtol)
    due = jnp.where(steady, t + period, jnp.inf) if solve.dt is None else trial.due
    return trial._replace(
        t=t,
        state=state,
        arrival=t,
        period=period,
        due=due,
        landing=jnp.zeros_like(trial.landing),
        footsteps=trial.footsteps + 1,
    )


def _along_course(motion: LandingMotion, state: Any, course: SurfaceCourse, time: Scalar) -> Any:
    """A state so short a time later that accelerations stay as they are."""
    _, rates = motion.system.coordinates(motion.args, state)
    half = 0.5 * time
    middle = (v + half * a for v, a in zip(rates, course.accelerations, strict=True))
    return advance(motion, state, time, [1.0], [(*middle, *course.accelerations)])


def _after_free_step(
    solve: Landing,
    now: LandingProgress,
    trial: Any,
    error: Scalar,
    length: Scalar,
    method: ExplicitMethod,
    rates: Rates,
    onto: StepOnto,
    endings: EndingWatch,
    changes: ModeEvents | None,
) -> tuple[LandingProgress, Scalar]:
    """After a free step: whether an arrival or an ending lies in it or beside it.

    Or a change of mode; what comes first is landed on. Also whether the step is kept. `rates` are
    those of the trial, roughly.
    """
    happens = events_within(
        solve.motion,
        now.step,
        (now.state, now.accelerations),
        (trial, rates),
        rtol=solve.rtol,
        length=length,
        begins_on_section=(now.footsteps > 0) & (now.t <= now.arrival),
        endings=endings is not EndingWatch.IGNORED,
        method=method,
    )
    grazes = happens.grazes
    if changes is not None:
        happens = with_changes(happens, changes)
        grazes = happens.grazes | changes.grazes
    ignored = endings is EndingWatch.IGNORED
    ending = _lost if ignored else functools.partial(solve.system.ending, solve.scene)
    code = ending(now.state)
    fits = error <= 1.0 if solve.dt is None else jnp.isfinite(error)
    keep = fits & ~happens.unclear & (code == 0)
    t = jnp.where(keep, now.t + now.step, now.t)
    beside = onto.near & onto.counts & (t + onto.rest <= solve.duration)
    arrived = keep & beside & happens.above & ~happens.grazes & ~happens.ends
    lands = happens.arrives | (happens.ends & (endings is EndingWatch.LOCATED))
    if solve.dt is None:
        pace = now.step * jnp.clip(_SAFETY / length, _MOST_SHRINK, _MOST_GROWTH)
    else:
        pace = jnp.where(fits, solve.dt, jnp.nan)
    modes, changed = now.modes, jnp.zeros_like(arrived)
    if changes is not None and modes is not None:
        due, which = modes.changing, jnp.where(happens.changes, 1 + changes.which, 0)
        alone = ~happens.arrives & ~happens.ends & ((which == 0) | (which == due))
        changed = keep & (due > 0) & alone & ~grazes & onto.near
        changed = changed & (t + onto.rest <= solve.duration)
        arrived = arrived & (which == 0) & (due == 0)
        lands = lands | happens.changes
        begun = keep & (jnp.arange(1, 1 + len(modes.paces)) == modes.behind)
        modes = modes._replace(
            changing=jnp.where(keep, jnp.where(changed, due, which), 0),
            changed=changed,
            paces=jnp.where(begun, jnp.maximum(now.pace, pace), modes.paces),
            behind=jnp.where(keep, 0, modes.behind),
        )
    lands = keep & lands & ~arrived & ~changed
    # A step that is too long to tell what happens within it is tried again at half the length.
    pace = jnp.where(happens.unclear & fits, 0.5 * now.step, pace)
    back = now.step * (happens.place - 1.0)
    lost = ~jnp.isfinite(pace) | (pace <= _ROUNDING * t)
    if endings is not EndingWatch.LOCATED:
        ends = keep if changes is None else keep & ~happens.changes
        code = jnp.where(ends, ending(trial), code)
        t = jnp.where(keep & happens.ends, t + back, t)
    after = now._replace(
        t=t,
        state=select(keep, trial, now.state),
        step=back,
        pace=pace,
        landing=jnp.where(lands, 1, 0),
        ending=lands & happens.ends,
        arrived=arrived,
        grazes=now.grazes + jnp.where(keep & grazes, 1, 0),
        code=jnp.where(lost, int(Ending.SOLVER_FAILED), code).astype(now.code.dtype),
        modes=modes,
    )
    return after, keep


def _lost(state: Any) -> Scalar:
    return jnp.where(jnp.isfinite(sum(state)), 0, int(Ending.SOLVER_FAILED))


def _landing(solve: Landing, now: LandingProgress, trial: Any, onto: StepOnto) -> LandingProgress:
    """After a step back towards an event: Newton's method goes on, or it has come."""
    missed = ~onto.near & (now.landing >= _MOST_LANDINGS)
    ends, lands, modes = now.ending & onto.near, onto.near & ~now.ending, now.modes
    if modes is not None:
        changing = modes.changing > 0
        lands = lands & ~changing
        modes = modes._replace(changed=onto.near & changing)
    # What looked like an arrival from afar may not count from near by.
    arrived = lands & onto.counts
    passes = lands & ~onto.counts
    t = now.t + now.step
    code = solve.system.ending_on_surface(solve.scene, trial)
    code = jnp.where(ends, code, jnp.where(missed, int(Ending.SOLVER_FAILED), now.code))
    return now._replace(
        t=t + jnp.where(ends, onto.rest, 0.0),
        state=select(ends, onto.state, trial),
        step=onto.rest,
        landing=jnp.where(passes, 0, now.landing + 1),
        arrived=arrived,
        code=code,
        modes=modes,
    )
