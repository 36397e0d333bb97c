"""Steps of the rigid walker: explicit Runge–Kutta in single support, ended by impacts."""

import functools
import operator
from typing import Any, NamedTuple

import diffrax
import jax.numpy as jnp
import jax.tree_util as jtu

from jaxbiped._types import Scalar
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.dynamics._rolling import rolling_rates
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.solve._ending import Ending, rigid_ending

_TABLEAU = diffrax.Dopri8.tableau
_ORDER = 8
_SAFETY, _MOST_SHRINK, _MOST_GROWTH = 0.8, 0.2, 5.0
_FIRST_STEP = 0.03
"""First step, in units of √(l/g)."""
_ROUNDING = 1e-14
"""Shortest step, as a share of the time."""
_CLOSED = 1e-12
"""Sum of the leg angles [rad] up to which the feet have not opened since the last strike."""
_NEAR = 3e-2
"""Sum of the leg angles from which one Euler step leads onto a strike, in units of √rtol: the
square of what is left is far below the tolerance."""
_NEWTON = 3
"""Newton steps on the quintic that guesses where a heel strike lies within a step."""
_MOST_LANDINGS = 12
"""Newton steps onto a heel strike, after which it counts as missed."""


class RigidWalk(NamedTuple):
    """One walk's inputs; every leaf a floating-point number.

    Attributes:
        scene, state: what walks, and from where.
        duration: simulated time [s].
        footsteps: heel strikes after which to end, 0 for no limit.
        rtol: relative tolerance; the absolute one (SI) is a hundredth of it.
        most_attempts: cap on the attempted steps.
    """

    scene: RigidScene
    state: RigidState
    duration: Any
    footsteps: Any
    rtol: Any
    most_attempts: Any


class RigidProgress(NamedTuple):
    """What is carried from one attempted step to the next.

    Attributes:
        t, state: so far.
        rates: angular accelerations of both legs there [rad/s²].
        step: to attempt next [s]; negative while a heel strike is landed on from beyond.
        pace: the last free step, with which the next footstep begins.
        landing: number of Newton steps onto a heel strike, 0 in free motion.
        struck: whether the last attempt ended by a heel strike.
        footsteps: how many so far.
        attempts: how many so far.
        code: of the `Ending` that came, 0 for none.
    """

    t: Scalar
    state: RigidState
    rates: tuple[Scalar, Scalar]
    step: Scalar
    pace: Scalar
    landing: Scalar
    struck: Scalar
    footsteps: Scalar
    attempts: Scalar
    code: Scalar


def begun(walk: RigidWalk) -> RigidProgress:
    """Before the first step."""
    zero = jnp.zeros_like(walk.duration)
    none = jnp.zeros((), dtype=jnp.int64)
    step = _FIRST_STEP * jnp.sqrt(walk.scene.walker.l / walk.scene.ground.g)
    step = jnp.minimum(step, walk.duration)
    no = jnp.asarray(False)
    rates = _accelerations(walk, walk.state)
    return RigidProgress(zero, walk.state, rates, step, step, none, no, none, none, none)


def attempted(walk: RigidWalk, now: RigidProgress) -> tuple[RigidProgress, Scalar]:
    """One attempted step further, and whether the walk is over (boolean)."""
    stages = _stages(walk, now)
    trial = _moved(walk, now.state, now.step, _TABLEAU.b_sol[:-1], stages)
    landing = now.landing > 0
    landed = _landing(walk, now, trial, stages[-1])
    # The last stage is the first one of the next step, after an impact from the new state.
    state = _where(landing, landed.state, trial)
    rates = _accelerations(walk, state)
    last = (trial.omega_1, trial.omega_2, *rates)
    free = _free(walk, now, trial, stages[-1], _error(walk, now, trial, [*stages, last]))
    after = _where(landing, landed, free)
    kept = landing | (after.t > now.t)
    after = after._replace(rates=_where(kept, rates, now.rates), attempts=now.attempts + 1)
    enough = (walk.footsteps > 0.0) & (after.footsteps.astype(after.t.dtype) >= walk.footsteps)
    done = enough | ((after.landing == 0) & (after.t >= walk.duration))
    tired = after.attempts.astype(after.t.dtype) >= walk.most_attempts
    code = jnp.where((after.code == 0) & tired & ~done, int(Ending.OUT_OF_STEPS), after.code)
    return after._replace(code=code), done | (code != 0)


def ending_of(walk: RigidWalk, now: RigidProgress, waits: Scalar) -> Scalar:
    """Code of the `Ending`; `waits`: whether the duration only bounds the wait for footsteps."""
    few = now.footsteps.astype(now.t.dtype) < walk.footsteps
    late = (now.code == 0) & few & waits
    return jnp.where(late, int(Ending.OUT_OF_STEPS), now.code)


def _free(
    walk: RigidWalk,
    now: RigidProgress,
    trial: RigidState,
    rates: tuple[Scalar, ...],
    error: Scalar,
) -> RigidProgress:
    """After a step in single support: kept or not, and whether a heel strike lies behind it."""
    old, old_rate = _opening(now.state)
    new, new_rate = _opening(trial)
    course = _Course.of(
        now.step, (old, old_rate, now.rates[0] + now.rates[1]), (new, new_rate, rates[2] + rates[3])
    )
    ahead = (trial.theta_1 > trial.theta_2) & (new <= 0.0)
    # A step so long that the legs open and close within it is tried again at half the length.
    turn = old_rate / jnp.where(old_rate == new_rate, 1.0, old_rate - new_rate)
    bulges = (old_rate > 0.0) & (new_rate < 0.0)
    bulges = bulges & (course.value(turn) > 0.0)
    skips = ahead & (old <= _CLOSED) & bulges
    keep = (error <= 1.0) & ~skips
    closes = keep & ahead & (old > _CLOSED)
    factor = _SAFETY * jnp.maximum(error, 1e-10) ** (-1.0 / _ORDER)
    pace = now.step * jnp.clip(factor, _MOST_SHRINK, _MOST_GROWTH)
    pace = jnp.where(skips, 0.5 * now.step, pace)
    back = now.step * (course.root() - 1.0)
    t = jnp.where(keep, now.t + now.step, now.t)
    code = jnp.where(keep & ~closes, rigid_ending(trial), 0)
    lost = ~jnp.isfinite(pace) | (pace <= _ROUNDING * t)
    return RigidProgress(
        t=t,
        state=_where(keep, trial, now.state),
        rates=now.rates,
        step=jnp.where(closes, back, jnp.minimum(pace, walk.duration - t)),
        pace=pace,
        landing=jnp.where(closes, 1, 0),
        struck=jnp.asarray(False),
        footsteps=now.footsteps,
        attempts=now.attempts,
        code=jnp.where(lost, int(Ending.SOLVER_FAILED), code).astype(now.code.dtype),
    )


def _landing(
    walk: RigidWalk, now: RigidProgress, trial: RigidState, rates: tuple[Scalar, ...]
) -> RigidProgress:
    """After a step back towards a heel strike: Newton's method goes on, or the foot strikes.

    `rates` are those of the trial, roughly.
    """
    opening, rate = _opening(trial)
    rest = -opening / jnp.where(rate == 0.0, 1.0, rate)
    struck = (jnp.abs(opening) <= _NEAR * jnp.sqrt(walk.rtol)) & (rate < 0.0)
    missed = ~struck & (now.landing >= _MOST_LANDINGS)
    t = now.t + now.step + jnp.where(struck, rest, 0.0)
    nearer = _moved(walk, trial, rest, [1.0], [rates])
    return RigidProgress(
        t=t,
        state=_where(struck, impact(walk.scene, nearer).state, trial),
        rates=now.rates,
        step=jnp.where(struck, jnp.minimum(now.pace, walk.duration - t), rest),
        pace=now.pace,
        landing=jnp.where(struck, 0, now.landing + 1),
        struck=struck,
        footsteps=now.footsteps + jnp.where(struck, 1, 0),
        attempts=now.attempts,
        code=jnp.where(missed, int(Ending.SOLVER_FAILED), now.code),
    )


def _stages(walk: RigidWalk, now: RigidProgress) -> list[tuple[Scalar, ...]]:
    """Rates of the angles and of their rates at the stages of a step, without the last."""
    state = now.state
    stages: list[tuple[Scalar, ...]] = [(state.omega_1, state.omega_2, *now.rates)]
    for row in _TABLEAU.a_lower[:-1]:
        at = _moved(walk, state, now.step, row, stages)
        stages.append((at.omega_1, at.omega_2, *_accelerations(walk, at)))
    return stages


def _error(
    walk: RigidWalk, now: RigidProgress, trial: RigidState, stages: list[tuple[Scalar, ...]]
) -> Scalar:
    """Error of a step in units of the tolerance, root mean square over the components."""
    share = jnp.zeros_like(now.t)
    for i, (a, b) in enumerate(zip(now.state[1:], trial[1:], strict=True)):
        error = now.step * _weighted(_TABLEAU.b_error, stages, i)
        size = walk.rtol * (0.01 + jnp.maximum(jnp.abs(a), jnp.abs(b)))
        share = share + (error / size) ** 2
    error = jnp.sqrt(0.25 * share)
    return jnp.where(jnp.isnan(error), jnp.inf, error)


def _accelerations(walk: RigidWalk, state: RigidState) -> tuple[Scalar, Scalar]:
    motion = rolling_rates(walk.scene, state)
    return motion.alpha_1, motion.alpha_2


def _moved(
    walk: RigidWalk,
    state: RigidState,
    step: Scalar,
    weights: Any,
    stages: list[tuple[Scalar, ...]],
) -> RigidState:
    """The state a step further, at weighted rates of its angles and of their rates."""
    old = state[1:]
    new = [leaf + step * _weighted(weights, stages, i) for i, leaf in enumerate(old)]
    walker = walk.scene.walker
    # The foot's centre moves by what the foot rolls, and the hip with it.
    sines = jnp.sin(old[1]) - jnp.sin(new[1])
    hip_x = state.hip_x + walker.hip_to_foot * sines + walker.r * (old[1] - new[1])
    return RigidState(hip_x, *new)


def _weighted(weights: Any, stages: list[tuple[Scalar, ...]], i: int) -> Scalar:
    pairs = zip(weights, stages, strict=True)
    terms = [float(weight) * stage[i] for weight, stage in pairs if weight != 0.0]
    return functools.reduce(operator.add, terms)


def _opening(state: RigidState) -> tuple[Scalar, Scalar]:
    """Sum of the leg angles and its rate: above zero while the swing foot ahead is off ground."""
    return state.theta_1 + state.theta_2, state.omega_1 + state.omega_2


class _Course(NamedTuple):
    """Hermite's quintic of the opening over a step, by its coefficients."""

    coefficients: tuple[Scalar, ...]

    @staticmethod
    def of(step: Scalar, old: tuple[Scalar, ...], new: tuple[Scalar, ...]) -> "_Course":
        """From values, rates and second derivatives at both ends."""
        rise = new[0] - old[0]
        p, q = step * old[1], step * new[1]
        a, b = 0.5 * step * step * old[2], 0.5 * step * step * new[2]
        return _Course(
            (
                old[0],
                p,
                a,
                10.0 * rise - 6.0 * p - 4.0 * q - 3.0 * a + b,
                -15.0 * rise + 8.0 * p + 7.0 * q + 3.0 * a - 2.0 * b,
                6.0 * rise - 3.0 * (p + q) - a + b,
            )
        )

    def value(self, x: Scalar) -> Scalar:
        """At a share `x` of the step."""
        return self._value_and_slope(x)[0]

    def root(self) -> Scalar:
        """The share of the step at which it falls through zero, roughly.

        Where Newton's method leaves the part that is known to hold it, that is halved: beside the
        strike the course may have a root behind it, at which the legs opened.
        """
        end = functools.reduce(operator.add, self.coefficients)
        rise = end - self.coefficients[0]
        x = -self.coefficients[0] / jnp.where(rise == 0.0, 1.0, rise)
        low, high = jnp.zeros_like(x), jnp.ones_like(x)
        for _ in range(_NEWTON):
            value, slope = self._value_and_slope(x)
            low, high = jnp.where(value > 0.0, x, low), jnp.where(value > 0.0, high, x)
            newton = x - value / jnp.where(slope == 0.0, 1.0, slope)
            inside = (slope < 0.0) & (newton >= low) & (newton <= high)
            x = jnp.where(inside, newton, 0.5 * (low + high))
        return x

    def _value_and_slope(self, x: Scalar) -> tuple[Scalar, Scalar]:
        value, slope = self.coefficients[-1], jnp.zeros_like(self.coefficients[-1])
        for coefficient in self.coefficients[-2::-1]:
            slope = slope * x + value
            value = value * x + coefficient
        return value, slope


def _where(condition: Scalar, a: Any, b: Any) -> Any:
    return jtu.tree_map(lambda x, y: jnp.where(condition, x, y), a, b)
