"""Steps of the rigid walker: explicit Runge–Kutta in single support, ended by impacts."""

from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._circular import sine_cosine
from jaxbiped._ending import Ending
from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.solve._ending import rigid_ending
from jaxbiped.solve._quintic import Quintic
from jaxbiped.solve._rolling_step import ORDER, Rates, accelerations, advance, rolling_step

_SAFETY, _MOST_SHRINK, _MOST_GROWTH = 0.8, 0.2, 5.0
_FIRST_STEP = 0.03
"""First step, in units of √(l/g)."""
_ROUNDING = 1e-14
"""Shortest step, as a share of the time."""
_CLOSED = 1e-12
"""Sum of the leg angles [rad] up to which the feet have not opened since the last strike."""
_NEAR = 0.1
"""Sum of the leg angles from which one Euler step leads onto a strike, in units of √rtol: the
square of what is left is far below the tolerance."""
_STRETCH = 1.15
"""By how much a step may be longer than chosen to end where a strike is due."""
_MOST_LANDINGS = 12
"""Newton steps onto a heel strike, after which it counts as missed."""


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
        step: to attempt next [s]; negative while a heel strike is landed on from beyond.
        pace: the last free step, with which the next footstep begins.
        strike, period: time of the last heel strike, and since the one before it [s].
        due: when the next one is expected [s]; infinite while footsteps differ in their periods.
        landing: number of Newton steps onto a heel strike, 0 in free motion.
        struck: whether the last attempt ended by a heel strike.
        footsteps: how many so far.
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
    struck: Scalar
    footsteps: Scalar
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
        struck=no,
        footsteps=none,
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
    walk: RigidWalk, now: RigidProgress, *, embedded: bool = False
) -> tuple[RigidProgress, Scalar]:
    """One attempted step further, and whether the walk is over (boolean).

    `embedded`: whether it goes on with the embedded solution; see `rolling_step`.
    """
    trial, error, roughly = rolling_step(
        walk.scene, now.state, now.rates, now.step, walk.rtol, embedded=embedded
    )
    strike = _strike(walk, trial, roughly)
    free, kept = _after_free_step(walk, now, trial, error, roughly, strike)
    landing = now.landing > 0
    after = select(landing, _landing(walk, now, trial, strike), free)
    after = select(after.struck, _after_strike(walk, after, strike), after)
    # The last stage is the first one of the next step, after an impact from the new state.
    rates = accelerations(walk.scene, select(after.struck, strike.state, trial))
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


class _Strike(NamedTuple):
    """The heel strike that a trial step ends beside, if it does.

    Attributes:
        near: whether one Euler step leads onto it.
        rest: from the trial to the strike [s], which may lie behind.
        state: after it.
    """

    near: Scalar
    rest: Scalar
    state: RigidState


def _strike(walk: RigidWalk, trial: RigidState, rates: Rates) -> _Strike:
    """`rates` are those of the trial, roughly."""
    opening, rate = _opening(trial)
    rest = -opening / jnp.where(rate == 0.0, 1.0, rate)
    nearer = advance(trial, rest, [1.0], [rates])
    # The hip stays where it is, over another leg.
    rolled = _rolled_distance(walk, nearer.theta_1) - _rolled_distance(walk, nearer.theta_2)
    after = impact(walk.scene, nearer).state._replace(hip_x=nearer.hip_x + rolled)
    near = (jnp.abs(opening) <= _NEAR * jnp.sqrt(walk.rtol)) & (rate < 0.0)
    return _Strike(near, rest, after)


def _after_strike(walk: RigidWalk, trial: RigidProgress, strike: _Strike) -> RigidProgress:
    """After the strike beside a trial. Where footsteps last alike, the next one is known."""
    t = trial.t + strike.rest
    period = t - trial.strike
    change_of_rest = jnp.abs(period - trial.period) * jnp.abs(_opening(trial.state)[1])
    steady = change_of_rest <= 2.0 * _NEAR * jnp.sqrt(walk.rtol)
    due = jnp.where(steady, t + period, jnp.inf)
    return trial._replace(
        t=t,
        state=strike.state,
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
    strike: _Strike,
) -> tuple[RigidProgress, Scalar]:
    """After a step in single support: whether a heel strike lies beside it or behind it.

    Also whether the step is kept. `rates` are those of the trial, roughly.
    """
    old, old_rate = _opening(now.state)
    new, new_rate = _opening(trial)
    opening_curve = Quintic.of(
        now.step, (old, old_rate, now.rates[0] + now.rates[1]), (new, new_rate, rates[2] + rates[3])
    )
    passed = trial.theta_1 > trial.theta_2
    ahead = passed & (new <= 0.0)
    # A step so long that the legs open and close within it is tried again at half the length.
    turn = old_rate / jnp.where(old_rate == new_rate, 1.0, old_rate - new_rate)
    bulges = (old_rate > 0.0) & (new_rate < 0.0)
    bulges = bulges & (opening_curve.value(turn) > 0.0)
    skips = ahead & (old <= _CLOSED) & bulges
    keep = (error <= 1.0) & ~skips
    t = jnp.where(keep, now.t + now.step, now.t)
    struck = keep & passed & strike.near & (old > _CLOSED) & (t + strike.rest <= walk.duration)
    closes = keep & ahead & (old > _CLOSED) & ~struck
    factor = _SAFETY * jnp.maximum(error, 1e-10) ** (-1.0 / ORDER)
    pace = now.step * jnp.clip(factor, _MOST_SHRINK, _MOST_GROWTH)
    pace = jnp.where(skips, 0.5 * now.step, pace)
    back = now.step * (opening_curve.root() - 1.0)
    code = jnp.where(keep & ~closes & ~struck, rigid_ending(trial), 0)
    lost = ~jnp.isfinite(pace) | (pace <= _ROUNDING * t)
    after = now._replace(
        t=t,
        state=select(keep, trial, now.state),
        step=jnp.where(closes, back, _step(walk, t, pace, now.due, now.period)),
        pace=pace,
        landing=jnp.where(closes, 1, 0),
        struck=struck,
        code=jnp.where(lost, int(Ending.SOLVER_FAILED), code).astype(now.code.dtype),
    )
    return after, keep


def _landing(
    walk: RigidWalk, now: RigidProgress, trial: RigidState, strike: _Strike
) -> RigidProgress:
    """After a step back towards a heel strike: Newton's method goes on, or the foot strikes."""
    missed = ~strike.near & (now.landing >= _MOST_LANDINGS)
    return now._replace(
        t=now.t + now.step,
        state=trial,
        step=strike.rest,
        landing=now.landing + 1,
        struck=strike.near,
        code=jnp.where(missed, int(Ending.SOLVER_FAILED), now.code),
    )


def _opening(state: RigidState) -> tuple[Scalar, Scalar]:
    """Sum of the leg angles and its rate: above zero while the swing foot ahead is off ground."""
    return state.theta_1 + state.theta_2, state.omega_1 + state.omega_2
