"""Steps of the rigid walker: explicit Runge–Kutta in single support, ended by impacts."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._state import RigidState
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._failure_events import rigid_ending
from jaxbiped.solve._rolling_step import (
    NEAR,
    Rates,
    StepOnto,
    accelerations,
    euler_step_onto,
    events_within,
    rolling_step,
)

_SAFETY, _MOST_SHRINK, _MOST_GROWTH = 0.8, 0.2, 5.0
_FIRST_STEP = 0.03
"""First step, in units of √(l/g)."""
_ROUNDING = 1e-14
"""Shortest step, as a share of the time."""
_STRETCH = 1.15
"""By how much a step may be longer than chosen to end where a strike is due."""
_MOST_LANDINGS = 12
"""Newton steps onto a heel strike or a fall, after which it counts as missed."""


class RigidWalk(NamedTuple):
    """One walk's inputs; every leaf a floating-point number.

    Attributes:
        scene, state: what walks, and from where.
        duration: simulated time [s].
        footsteps: heel strikes after which to end, 0 for no limit.
        rtol: relative tolerance; the absolute one (SI) is a hundredth of it.
        max_attempts: cap on the attempted steps.
    """

    scene: RigidScene
    state: RigidState
    duration: Scalar
    footsteps: Scalar
    rtol: Scalar
    max_attempts: Scalar


class RigidProgress(NamedTuple):
    """What is carried from one attempted step to the next.

    Attributes:
        t, state: so far; hip_x is where the hip is, was or would be with the stance leg upright,
            which changes at strikes alone. `state_with_hip` gives the hip's own.
        rates: angular accelerations of both legs there [rad/s²].
        step: to attempt next [s]; negative while a heel strike or a fall is landed on from beyond.
        pace: the last free step, with which the next footstep begins.
        strike, period: time of the last heel strike, and since the one before it [s].
        due: when the next one is expected [s]; infinite while footsteps differ in their periods.
        landing: number of Newton steps onto a heel strike or a fall, 0 in free motion.
        falling: whether that is a fall.
        struck: whether the last attempt ended by a heel strike.
        footsteps: how many so far.
        grazes: steps so far of which the tolerance does not tell whether the foot came down.
        accepted, rejected: attempted steps so far, by what became of them.
        code: of the `Ending` that came, 0 for none.
    """

    t: Scalar
    state: RigidState
    rates: tuple[Scalar, Scalar]
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
    accepted: Scalar
    rejected: Scalar
    code: Scalar


def initial_progress(walk: RigidWalk) -> RigidProgress:
    """Before the first step."""
    zero = jnp.zeros_like(walk.duration)
    none = jnp.zeros((), dtype=jnp.int64)
    step = _FIRST_STEP * jnp.sqrt(walk.scene.walker.l / walk.scene.ground.g)
    step = jnp.minimum(step, walk.duration)
    no = jnp.asarray(False)
    rates = accelerations(walk.scene, walk.state)
    upright = walk.state._replace(
        hip_x=walk.state.hip_x + _rolled_distance(walk, walk.state.theta_2)
    )
    never = jnp.full_like(zero, jnp.inf)
    return RigidProgress(
        t=zero,
        state=upright,
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
        accepted=none,
        rejected=none,
        code=none,
    )


def state_with_hip(walk: RigidWalk, now: RigidProgress) -> RigidState:
    """The state with the hip where it is."""
    state = now.state
    return state._replace(hip_x=state.hip_x - _rolled_distance(walk, state.theta_2))


def _rolled_distance(walk: RigidWalk, angle: Scalar) -> Scalar:
    """How far the hip goes from a stance leg at this angle to one that is upright [m]."""
    walker = walk.scene.walker
    return walker.hip_to_foot * sine_cosine(angle)[0] + walker.r * angle


def attempt_step(
    walk: RigidWalk, now: RigidProgress, *, embedded: bool = False, lands_on_falls: bool = True
) -> tuple[RigidProgress, Scalar]:
    """One attempted step further, and whether the walk is over (boolean).

    `embedded`: whether it goes on with the embedded solution; see `rolling_step`. A fall that is
    not landed on, which saves a step, has its time by interpolation, and no accurate state.
    """
    trial, error, roughly = rolling_step(
        walk.scene, now.state, now.rates, now.step, walk.rtol, embedded=embedded
    )
    onto = euler_step_onto(now.falling, trial, roughly, walk.rtol)
    free, kept = _after_free_step(walk, now, trial, error, roughly, onto, lands_on_falls)
    landing = now.landing > 0
    after = select(landing, _landing(now, trial, onto), free)
    strike = _strike(walk, onto)
    after = select(after.struck, _after_strike(walk, after, onto, strike), after)
    # The last stage is the first one of the next step, after an impact from the new state.
    rates = accelerations(walk.scene, select(after.struck, strike, trial))
    accepted = landing | kept
    rates = select(accepted, rates, now.rates)
    one = jnp.where(accepted, 1, 0)
    after = after._replace(
        rates=rates, accepted=now.accepted + one, rejected=now.rejected + (1 - one)
    )
    enough = (walk.footsteps > 0.0) & (after.footsteps.astype(after.t.dtype) >= walk.footsteps)
    done = enough | ((after.landing == 0) & (after.t >= walk.duration))
    attempts = (after.accepted + after.rejected).astype(after.t.dtype)
    tired = attempts >= walk.max_attempts
    code = jnp.where((after.code == 0) & tired & ~done, int(Ending.OUT_OF_STEPS), after.code)
    return after._replace(code=code), done | (code != 0)


def ending_of(walk: RigidWalk, now: RigidProgress, waits: Scalar) -> Scalar:
    """Code of the `Ending`; `waits`: whether the duration only bounds the wait for footsteps."""
    few = now.footsteps.astype(now.t.dtype) < walk.footsteps
    late = (now.code == 0) & few & waits
    return jnp.where(late, int(Ending.TIMED_OUT), now.code)


def _strike(walk: RigidWalk, onto: StepOnto) -> RigidState:
    """The state after a heel strike: the hip stays where it is, over another leg."""
    at = onto.state
    rolled = _rolled_distance(walk, at.theta_1) - _rolled_distance(walk, at.theta_2)
    return impact(walk.scene, at).state._replace(hip_x=at.hip_x + rolled)


def _after_strike(
    walk: RigidWalk, trial: RigidProgress, onto: StepOnto, state: RigidState
) -> RigidProgress:
    """After the strike beside a trial. Where footsteps last alike, the next one is known."""
    t = trial.t + onto.rest
    period = t - trial.strike
    rate = trial.state.omega_1 + trial.state.omega_2
    change_of_rest = jnp.abs(period - trial.period) * jnp.abs(rate)
    steady = change_of_rest <= 2.0 * NEAR * jnp.sqrt(walk.rtol)
    due = jnp.where(steady, t + period, jnp.inf)
    return trial._replace(
        t=t,
        state=state,
        step=_step(walk, t, trial.pace, due, period),
        strike=t,
        period=period,
        due=due,
        landing=jnp.zeros_like(trial.landing),
        footsteps=trial.footsteps + 1,
    )


def _step(walk: RigidWalk, t: Scalar, pace: Scalar, due: Scalar, period: Scalar) -> Scalar:
    """The next step: the pace, or what ends it where a strike is due or the walk ends [s]."""
    left = due - t
    hits = (left > 1e-6 * period) & (left <= _STRETCH * pace)
    return jnp.minimum(jnp.where(hits, left, pace), walk.duration - t)


def _after_free_step(
    walk: RigidWalk,
    now: RigidProgress,
    trial: RigidState,
    error: Scalar,
    rates: Rates,
    onto: StepOnto,
    lands_on_falls: bool,
) -> tuple[RigidProgress, Scalar]:
    """After a step in single support: whether a heel strike or a fall lies in it or beside it.

    Also whether the step is kept. `rates` are those of the trial, roughly.
    """
    # As the step to which the error is a unit: its eighth root, for the order is 8.
    length = jnp.sqrt(jnp.sqrt(jnp.sqrt(jnp.maximum(error, 1e-10))))
    happens = events_within(
        now.step,
        (now.state, now.rates),
        (trial, rates),
        rtol=walk.rtol,
        length=length,
        begins_on_section=(now.footsteps > 0) & (now.t <= now.strike),
    )
    fallen = rigid_ending(now.state)
    keep = (error <= 1.0) & ~happens.unclear & (fallen == 0)
    t = jnp.where(keep, now.t + now.step, now.t)
    beside = onto.near & (trial.theta_1 > trial.theta_2) & (t + onto.rest <= walk.duration)
    struck = keep & beside & happens.above & ~happens.grazes & ~happens.falls
    lands = keep & (happens.strikes | (happens.falls & lands_on_falls)) & ~struck
    pace = now.step * jnp.clip(_SAFETY / length, _MOST_SHRINK, _MOST_GROWTH)
    # A step that is too long to tell what happens within it is tried again at half the length.
    pace = jnp.where(happens.unclear & (error <= 1.0), 0.5 * now.step, pace)
    back = now.step * (happens.place - 1.0)
    lost = ~jnp.isfinite(pace) | (pace <= _ROUNDING * t)
    if not lands_on_falls:
        fallen = jnp.where(keep, rigid_ending(trial), fallen)
        t = jnp.where(keep & happens.falls, t + back, t)
    after = now._replace(
        t=t,
        state=select(keep, trial, now.state),
        step=jnp.where(lands, back, _step(walk, t, pace, now.due, now.period)),
        pace=pace,
        landing=jnp.where(lands, 1, 0),
        falling=lands & happens.falls,
        struck=struck,
        grazes=now.grazes + jnp.where(keep & happens.grazes, 1, 0),
        code=jnp.where(lost, int(Ending.SOLVER_FAILED), fallen).astype(now.code.dtype),
    )
    return after, keep


def _landing(now: RigidProgress, trial: RigidState, onto: StepOnto) -> RigidProgress:
    """After a step back towards an event: Newton's method goes on, or it has come."""
    missed = ~onto.near & (now.landing >= _MOST_LANDINGS)
    falls = now.falling & onto.near
    code = jnp.where(trial.theta_2 < 0.0, int(Ending.FELL_FORWARD), int(Ending.FELL_BACK))
    code = jnp.where(falls, code, jnp.where(missed, int(Ending.SOLVER_FAILED), now.code))
    return now._replace(
        t=now.t + now.step + jnp.where(falls, onto.rest, 0.0),
        state=select(falls, onto.state, trial),
        step=onto.rest,
        landing=now.landing + 1,
        struck=onto.near & ~now.falling,
        code=code,
    )
