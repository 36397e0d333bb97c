"""Steps of the rigid walker: explicit Runge–Kutta in single support, ended by impacts."""

import enum
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._mode_changes import SLACK, change_mode
from jaxbiped.dynamics._stance import Stance, angles_and_rates, of_stance
from jaxbiped.dynamics._stance_motion import ground_force, rolling_rates
from jaxbiped.dynamics._surfaces import lean
from jaxbiped.hybrid._endings import rigid_ending
from jaxbiped.scene._modes import rigid_modes
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._explicit_methods import ExplicitMethod
from jaxbiped.solve._rolling_step import (
    DOPRI8,
    EULER_DISTANCE,
    ModeEvents,
    Rates,
    StepOnto,
    SurfaceCourse,
    advance,
    course_of,
    euler_step_onto,
    events_within,
    mode_events,
    onto_surface,
    rolling_step,
    root_place,
    shifted,
    with_changes,
)

_FIRST_STEP = 0.03
"""First step, in units of √(l/g)."""
_STRETCH = 1.15
"""By how much a step may be longer than chosen to end where a strike is due."""


class RigidWalk(NamedTuple):
    """One walk's inputs; every leaf a floating-point number.

    Attributes:
        scene, state: what walks, and from where.
        duration: simulated time [s].
        footsteps: heel strikes after which to end, 0 for no limit.
        rtol: relative tolerance; the absolute one (SI) is a hundredth of it.
        max_attempts: cap on the attempted steps.
        recording: inputs of who looks at the steps, if it has any.
        dt: length of all steps [s]; None: each is as long as its error allows.
    """

    scene: RigidScene
    state: Any
    duration: Scalar
    footsteps: Scalar
    rtol: Scalar
    max_attempts: Scalar
    recording: Any = None
    dt: Scalar | None = None


class RigidProgress(NamedTuple):
    """What is carried from one attempted step to the next.

    Attributes:
        t, state: so far; the place is the standing foot's at its body's angle 0, which changes
            where another foot stands. `state_with_hip` gives the root point's own.
        rates: angular accelerations there [rad/s²].
        step: to attempt next [s]; negative while a heel strike or a fall is landed on from beyond.
        pace: the last free step, with which the next footstep begins.
        strike, period: time of the last heel strike, and since the one before it [s].
        due: when the next one is expected [s]; infinite while footsteps differ in their periods.
        landing: number of Newton steps onto a heel strike or a fall, 0 in free motion.
        falling: whether that is a fall.
        struck: whether the last attempt ended by a heel strike.
        footsteps: how many so far.
        grazes: steps so far of which the tolerance does not tell whether the foot came down.
        pulls: steps so far behind which the walker `is_pulled`, where they are counted.
        accepted, rejected: attempted steps so far, by what became of them.
        code: of the `Ending` that came, 0 for none.
        modes: what is known of mode changes; None where only one mode can occur.
    """

    t: Scalar
    state: Any
    rates: tuple[Scalar, ...]
    step: Scalar
    pace: Scalar
    strike: Scalar
    period: Scalar
    due: Scalar
    landing: Scalar
    falling: Scalar
    struck: Scalar
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
        met: when each was last changed at [s].
        paces: first steps behind a heel strike, then behind each change [s]; 0 where unknown.
        behind: number of the one of these that the next step begins from, counted from one; 0 for
            none.
    """

    course: SurfaceCourse
    changing: Scalar
    changed: Scalar
    begin: Scalar
    met: Scalar
    paces: Scalar
    behind: Scalar


def initial_progress(walk: RigidWalk) -> RigidProgress:
    """Before the first step."""
    zero = jnp.zeros_like(walk.duration)
    none = jnp.zeros((), dtype=jnp.int64)
    step = walk.dt
    if step is None:
        step = _FIRST_STEP * jnp.sqrt(walk.scene.mechanism.height / walk.scene.ground.g)
    step = jnp.minimum(step, walk.duration)
    no = jnp.asarray(False)
    state, modes = walk.state, None
    if rigid_modes(walk.scene.mechanism).may_change:
        state = change_mode(walk.scene, state)
        course = course_of(walk.scene, state)
        paces = jnp.zeros(1 + len(course.values), zero.dtype)
        met = jnp.full_like(paces[1:], -jnp.inf)
        modes = ModeProgress(course, none, no, state.mode, met, paces, none)
    rates = rolling_rates(walk.scene, state) if modes is None else modes.course.turning
    never = jnp.full_like(zero, jnp.inf)
    return RigidProgress(
        t=zero,
        state=shifted(state, -root_place(walk.scene, state)),
        rates=rates,
        step=step,
        pace=step,
        strike=zero,
        period=never,
        due=never,
        landing=none,
        falling=no,
        struck=no,
        footsteps=none,
        grazes=none,
        pulls=none,
        accepted=none,
        rejected=none,
        code=none,
        modes=modes,
    )


def with_next_step(walk: RigidWalk, after: RigidProgress) -> RigidProgress:
    """With its step, unless it lands: the pace, or what ends it where an event or the end is due.

    Where footsteps last alike a mode changes as long behind the strike as it did in the last one.
    """
    left, modes = after.due - after.t, after.modes
    changing, least = jnp.zeros_like(after.landing), 1e-6 * after.period
    if modes is not None:
        steady = after.due < jnp.inf
        for k, met in enumerate(modes.met, start=1):
            waits = met + after.period - after.t
            first = steady & (waits > least) & (waits < left)
            left, changing = select(first, (waits, jnp.full_like(changing, k)), (left, changing))
    hits = (left > least) & (left <= _STRETCH * after.pace)
    step = jnp.minimum(jnp.where(hits, left, after.pace), walk.duration - after.t)
    lands = after.landing > 0
    if modes is not None:
        changing = jnp.where(lands, modes.changing, jnp.where(hits, changing, 0))
        modes = modes._replace(changing=changing)
    return after._replace(step=jnp.where(lands, after.step, step), modes=modes)


def is_pulled(walk: RigidWalk, now: RigidProgress) -> Scalar:
    """Whether the ground has to pull on the leg that stands, where a real foot would fly."""

    def load(stance: Stance) -> Scalar:
        return ground_force(walk.scene, stance, now.rates).normal

    return (now.landing == 0) & (of_stance(walk.scene, now.state, load) < 0.0)


_SAFETY, _MOST_SHRINK, _MOST_GROWTH = 0.8, 0.2, 5.0
_ROUNDING = 1e-14
"""Shortest step, as a share of the time."""
_LANDED = 1e-3
"""How near a landing comes to where a load is zero, in units of the tolerance."""
_MOST_LANDINGS = 12
"""Newton steps onto a heel strike or a fall, after which it counts as missed."""


class Attempted(NamedTuple):
    """An attempted step.

    Attributes:
        after: what is then carried.
        over: whether the walk is over (boolean).
        accepted: whether the step was accepted.
        end: gives the state at its end, before what an impact or a change of mode makes of it.
        stages: rates of its stages.
        trial: where these lead.
    """

    after: RigidProgress
    over: Scalar
    accepted: Scalar
    end: Callable[[], Any]
    stages: list[Rates]
    trial: Any


class FallWatch(enum.Enum):
    """What becomes of falls."""

    LOCATED = enum.auto()
    """They are landed on, and end the walk."""
    TOLD = enum.auto()
    """They end the walk, at a time by interpolation, with no accurate state: it saves a step."""
    IGNORED = enum.auto()
    """The walk goes on."""


def attempt_step(
    walk: RigidWalk,
    now: RigidProgress,
    *,
    method: ExplicitMethod = DOPRI8,
    falls: FallWatch = FallWatch.LOCATED,
) -> Attempted:
    """One attempted step further."""
    trial, error, stages = rolling_step(
        walk.scene, now.state, now.rates, now.step, walk.rtol, method=method
    )
    roughly = stages[-1]
    onto = euler_step_onto(walk.scene, now.falling, trial, roughly, walk.rtol)
    length = method.length(error)
    course = changes = None
    if now.modes is not None:
        course = course_of(walk.scene, trial)
        changes = mode_events(now.step, now.modes.course, course, walk.rtol, length, method)
        surface = onto_surface(course, now.modes.changing - 1, walk.rtol, now.pace)
        there = _along_course(walk, trial, course, surface.rest)
        own = onto._replace(near=surface.near, rest=surface.rest, state=there)
        onto = select(now.modes.changing > 0, own, onto)
    free, kept = _after_free_step(
        walk, now, trial, error, length, method, roughly, onto, falls, changes
    )
    landing = now.landing > 0
    after = select(landing, _landing(walk, now, trial, onto), free)
    if now.modes is None:
        strike = _strike(walk, onto)
    else:  # with stops an impact is much work
        strike = jax.lax.cond(after.struck, lambda: _strike(walk, onto), lambda: onto.state)
    tried = after

    def end() -> Any:
        state = select(tried.struck, onto.state, tried.state)
        return state if tried.modes is None else select(tried.modes.changed, onto.state, state)

    accepted = landing | kept
    after = select(after.struck, _after_strike(walk, after, onto, strike), after)
    # The last stage is the first one of the next step, after an impact from the new state.
    if now.modes is None:
        rates = rolling_rates(walk.scene, select(after.struck, strike, trial))
        rates = select(accepted, rates, now.rates)
    else:
        after = _after_change(walk, after, onto, select(accepted, course, now.modes.course))
        assert after.modes is not None
        rates = after.modes.course.turning
    one = jnp.where(accepted, 1, 0)
    after = after._replace(
        rates=rates, accepted=now.accepted + one, rejected=now.rejected + (1 - one)
    )
    after = with_next_step(walk, after)
    enough = (walk.footsteps > 0.0) & (after.footsteps.astype(after.t.dtype) >= walk.footsteps)
    done = enough | ((after.landing == 0) & (after.t >= walk.duration))
    attempts = (after.accepted + after.rejected).astype(after.t.dtype)
    tired = attempts >= walk.max_attempts
    code = jnp.where((after.code == 0) & tired & ~done, int(Ending.OUT_OF_STEPS), after.code)
    return Attempted(after._replace(code=code), done | (code != 0), accepted, end, stages, trial)


def ending_of(walk: RigidWalk, now: RigidProgress, waits: Scalar) -> Scalar:
    """Code of the `Ending`; `waits`: whether the duration only bounds the wait for footsteps."""
    few = now.footsteps.astype(now.t.dtype) < walk.footsteps
    late = (now.code == 0) & few & waits
    return jnp.where(late, int(Ending.TIMED_OUT), now.code)


def _strike(walk: RigidWalk, onto: StepOnto) -> Any:
    """The state after a heel strike: the root point stays where it is, over another leg."""
    at = onto.state
    after = impact(walk.scene, at).state
    return shifted(after, root_place(walk.scene, at) - root_place(walk.scene, after))


def _after_change(
    walk: RigidWalk, trial: RigidProgress, onto: StepOnto, course: Any
) -> RigidProgress:
    """After the change of mode beside a trial; with its surfaces, wherever the walk is now."""
    assert trial.modes is not None
    changed = trial.modes.changed
    slack = jnp.maximum(SLACK, walk.rtol)
    state = jax.lax.cond(
        changed,
        lambda: change_mode(walk.scene, onto.state, slack, _LANDED * slack),
        lambda: trial.state,
    )
    # Where another foot of its leg stands the place is told from that one.
    moved = root_place(walk.scene, onto.state) - root_place(walk.scene, state)
    state = shifted(state, jnp.where(changed, moved, 0.0))
    t = jnp.where(changed, trial.t + onto.rest, trial.t)
    event = jnp.where(trial.struck, 1, jnp.where(changed, 1 + trial.modes.changing, 0))
    happened = jnp.arange(1, 1 + len(trial.modes.paces)) == event
    known = jnp.sum(jnp.where(happened, trial.modes.paces, 0.0))
    modes = trial.modes._replace(
        course=jax.lax.cond(
            trial.struck | changed, lambda: course_of(walk.scene, state), lambda: course
        ),
        changing=jnp.where(changed, 0, trial.modes.changing),
        met=jnp.where(happened[1:], t, trial.modes.met),
        behind=jnp.where(event > 0, event, trial.modes.behind),
    )
    return trial._replace(
        t=t,
        state=state,
        pace=jnp.where(known > 0.0, known, trial.pace) if walk.dt is None else trial.pace,
        landing=jnp.where(changed, 0, trial.landing),
        modes=modes,
    )


def _after_strike(
    walk: RigidWalk, trial: RigidProgress, onto: StepOnto, state: Any
) -> RigidProgress:
    """After the strike beside a trial. Where footsteps last alike, the next one is known."""
    t = trial.t + onto.rest
    period = t - trial.strike
    change_of_rest = jnp.abs(period - trial.period) * jnp.abs(onto.closing)
    steady = change_of_rest <= 2.0 * EULER_DISTANCE * jnp.sqrt(walk.rtol)
    due = jnp.where(steady, t + period, jnp.inf) if walk.dt is None else trial.due
    return trial._replace(
        t=t,
        state=state,
        strike=t,
        period=period,
        due=due,
        landing=jnp.zeros_like(trial.landing),
        footsteps=trial.footsteps + 1,
    )


def _along_course(walk: RigidWalk, state: Any, course: SurfaceCourse, time: Scalar) -> Any:
    """A state so short a time later that accelerations stay as they are."""
    _, rates = angles_and_rates(walk.scene.mechanism.structure, state)
    half = 0.5 * time
    middle = (rate + half * turning for rate, turning in zip(rates, course.turning, strict=True))
    return advance(state, time, [1.0], [(*middle, *course.turning)])


def _after_free_step(
    walk: RigidWalk,
    now: RigidProgress,
    trial: Any,
    error: Scalar,
    length: Scalar,
    method: ExplicitMethod,
    rates: Rates,
    onto: StepOnto,
    falls: FallWatch,
    changes: ModeEvents | None,
) -> tuple[RigidProgress, Scalar]:
    """After a step in single support: whether a heel strike or a fall lies in it or beside it.

    Or a change of mode; what comes first is landed on. Also whether the step is kept. `rates` are
    those of the trial, roughly.
    """
    happens = events_within(
        walk.scene,
        now.step,
        (now.state, now.rates),
        (trial, rates),
        rtol=walk.rtol,
        length=length,
        begins_on_section=(now.footsteps > 0) & (now.t <= now.strike),
        falls=falls is not FallWatch.IGNORED,
        method=method,
    )
    grazes = happens.grazes
    if changes is not None:
        happens = with_changes(happens, changes)
        grazes = happens.grazes | changes.grazes
    ending = functools.partial(rigid_ending, walk.scene, falls=falls is not FallWatch.IGNORED)
    fallen = ending(now.state)
    fits = error <= 1.0 if walk.dt is None else jnp.isfinite(error)
    keep = fits & ~happens.unclear & (fallen == 0)
    t = jnp.where(keep, now.t + now.step, now.t)
    beside = onto.near & onto.ahead & (t + onto.rest <= walk.duration)
    struck = keep & beside & happens.above & ~happens.grazes & ~happens.falls
    lands = happens.strikes | (happens.falls & (falls is FallWatch.LOCATED))
    if walk.dt is None:
        pace = now.step * jnp.clip(_SAFETY / length, _MOST_SHRINK, _MOST_GROWTH)
    else:
        pace = jnp.where(fits, walk.dt, jnp.nan)
    modes, changed = now.modes, jnp.zeros_like(struck)
    if changes is not None and modes is not None:
        due, which = modes.changing, jnp.where(happens.changes, 1 + changes.which, 0)
        alone = ~happens.strikes & ~happens.falls & ((which == 0) | (which == due))
        changed = keep & (due > 0) & alone & ~grazes & onto.near
        changed = changed & (t + onto.rest <= walk.duration)
        struck = struck & (which == 0) & (due == 0)
        lands = lands | happens.changes
        begun = keep & (jnp.arange(1, 1 + len(modes.paces)) == modes.behind)
        modes = modes._replace(
            changing=jnp.where(keep, jnp.where(changed, due, which), 0),
            changed=changed,
            paces=jnp.where(begun, jnp.maximum(now.pace, pace), modes.paces),
            behind=jnp.where(keep, 0, modes.behind),
        )
    lands = keep & lands & ~struck & ~changed
    # A step that is too long to tell what happens within it is tried again at half the length.
    pace = jnp.where(happens.unclear & fits, 0.5 * now.step, pace)
    back = now.step * (happens.place - 1.0)
    lost = ~jnp.isfinite(pace) | (pace <= _ROUNDING * t)
    if falls is not FallWatch.LOCATED:
        ends = keep if changes is None else keep & ~happens.changes
        fallen = jnp.where(ends, ending(trial), fallen)
        t = jnp.where(keep & happens.falls, t + back, t)
    after = now._replace(
        t=t,
        state=select(keep, trial, now.state),
        step=back,
        pace=pace,
        landing=jnp.where(lands, 1, 0),
        falling=lands & happens.falls,
        struck=struck,
        grazes=now.grazes + jnp.where(keep & grazes, 1, 0),
        code=jnp.where(lost, int(Ending.SOLVER_FAILED), fallen).astype(now.code.dtype),
        modes=modes,
    )
    return after, keep


def _landing(walk: RigidWalk, now: RigidProgress, trial: Any, onto: StepOnto) -> RigidProgress:
    """After a step back towards an event: Newton's method goes on, or it has come."""
    missed = ~onto.near & (now.landing >= _MOST_LANDINGS)
    falls, lands, modes = now.falling & onto.near, onto.near & ~now.falling, now.modes
    if modes is not None:
        changing = modes.changing > 0
        lands = lands & ~changing
        modes = modes._replace(changed=onto.near & changing)
    # What looked like a strike from afar may be two legs that pass each other.
    struck = lands & onto.ahead
    passes = lands & ~onto.ahead
    t = now.t + now.step
    code = jnp.where(lean(walk.scene, trial) < 0.0, int(Ending.FELL_FORWARD), int(Ending.FELL_BACK))
    code = jnp.where(falls, code, jnp.where(missed, int(Ending.SOLVER_FAILED), now.code))
    return now._replace(
        t=t + jnp.where(falls, onto.rest, 0.0),
        state=select(falls, onto.state, trial),
        step=onto.rest,
        landing=jnp.where(passes, 0, now.landing + 1),
        struck=struck,
        code=code,
        modes=modes,
    )
