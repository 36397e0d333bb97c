"""Rolling step: single support of the rigid walker by Dormand and Prince's method of order 8.

Heel strikes and falls within it are located on its interpolant. A heel strike is where the opening,
the sum of the leg angles, falls through zero while the swing leg is ahead. Both are asked at the
root: a leg that swings back fast has struck and is behind again by the end of a step.
"""

import functools
import operator
from collections.abc import Sequence
from typing import NamedTuple

import diffrax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._rolling import rolling_rates
from jaxbiped.dynamics._state import RigidState
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._failure_events import FALL_ANGLE
from jaxbiped.solve._step_polynomials import Quintic

_TABLEAU = diffrax.Dopri8.tableau
Rates = tuple[Scalar, Scalar, Scalar, Scalar]
"""Rates of the angles and of their rates."""
_INTERPOLATED = 2.0
"""Largest error of the interpolated opening [rad], as measured, over a step whose own error is the
tolerance, in units of rtol^¾."""
_RESOLVED = 1.0
"""Error that an opening may have [rad], in units of rtol."""
NEAR = 0.1
"""Distance from a surface [rad] from which one Euler step leads onto it, in units of √rtol, where
its rate changes little by then: the square of what is left is far below the tolerance."""
_ON_SECTION = 1e-12
"""Opening [rad] up to which a walk begins on the section: its rate tells on which side it is."""


def rolling_step(
    scene: RigidScene,
    state: RigidState,
    at_start: tuple[Scalar, Scalar],
    step: Scalar,
    rtol: Scalar,
    *,
    embedded: bool = False,
) -> tuple[RigidState, Scalar, Rates]:
    """The state a step further, its error in units of the tolerance, and its rates, roughly.

    `at_start` are the angular accelerations at the start. The place along the slope stays. Of the
    error, the root mean square over the components; infinite where it is no number. `embedded`:
    whether to go on with the embedded solution of order 7, by which the error is estimated: another
    method of steps, which a witness of errors takes.
    """
    stages: list[Rates] = [(state.omega_1, state.omega_2, *at_start)]
    for row in _TABLEAU.a_lower[:-1]:
        at = advance(state, step, row, stages)
        stages.append((at.omega_1, at.omega_2, *accelerations(scene, at)))
    weights = _TABLEAU.b_sol - _TABLEAU.b_error if embedded else _TABLEAU.b_sol
    end = advance(state, step, weights[:-1], stages)
    share = jnp.zeros_like(step)
    for i, (a, b) in enumerate(zip(recurring_leaves(state), recurring_leaves(end), strict=True)):
        error = step * _weighted(_TABLEAU.b_error[:-1], stages, i)
        size = rtol * (0.01 + jnp.maximum(jnp.abs(a), jnp.abs(b)))
        share = share + (error / size) ** 2
    error = jnp.sqrt(0.25 * share)
    return end, jnp.where(jnp.isnan(error), jnp.inf, error), stages[-1]


def accelerations(scene: RigidScene, state: RigidState) -> tuple[Scalar, Scalar]:
    """Angular accelerations of swing leg and stance leg [rad/s²]."""
    motion = rolling_rates(scene, state)
    return motion.alpha_1, motion.alpha_2


def advance(
    state: RigidState, step: Scalar, weights: Sequence[float] | np.ndarray, stages: list[Rates]
) -> RigidState:
    """The state a step further, at weighted rates of its angles and of their rates."""
    old = recurring_leaves(state)
    new = (leaf + step * _weighted(weights, stages, i) for i, leaf in enumerate(old))
    return RigidState(state.hip_x, *new)


def _weighted(weights: Sequence[float] | np.ndarray, stages: list[Rates], i: int) -> Scalar:
    pairs = zip(weights, stages, strict=True)
    terms = [float(weight) * stage[i] for weight, stage in pairs if weight != 0.0]
    return functools.reduce(operator.add, terms)


class Surface(NamedTuple):
    """How far a state is from where something happens, and how fast that changes.

    Attributes:
        value: above zero before it [rad].
        rate, curvature: its first two derivatives with respect to time.
    """

    value: Scalar
    rate: Scalar
    curvature: Scalar


def opening(state: RigidState, rates: tuple[Scalar, ...]) -> Surface:
    """Sum of the leg angles: above zero while the swing foot ahead is off the ground.

    `rates` end with the accelerations of both legs.
    """
    return Surface(
        state.theta_1 + state.theta_2, state.omega_1 + state.omega_2, rates[-2] + rates[-1]
    )


def uprightness(state: RigidState, rates: tuple[Scalar, ...], side: Scalar) -> Surface:
    """What is left of the stance leg's angle before the walker has fallen, to this side (±1)."""
    return Surface(FALL_ANGLE - side * state.theta_2, -side * state.omega_2, -side * rates[-1])


class StepEvents(NamedTuple):
    """What happens within a step; booleans, but for the place.

    Attributes:
        strikes, falls: whether the swing foot comes down, or the stance leg too far.
        place: the share of the step that lies before, roughly.
        unclear: whether the step is too long to tell.
        above: whether it begins before a strike, not under the ground.
        grazes: whether it depends on less than the opening is known to.
    """

    strikes: Scalar
    falls: Scalar
    place: Scalar
    unclear: Scalar
    above: Scalar
    grazes: Scalar


def events_within(
    step: Scalar,
    before: tuple[RigidState, tuple[Scalar, Scalar]],
    after: tuple[RigidState, Rates],
    *,
    rtol: Scalar,
    length: Scalar,
    begins_on_section: Scalar,
) -> StepEvents:
    """What happens within a step.

    Args:
        step: its length [s].
        before, after: states at both ends, and the legs' accelerations there.
        rtol: relative tolerance.
        length: its length in units of the one whose error is the tolerance.
        begins_on_section: whether it begins with a heel strike (boolean).
    """
    foot = Quintic.of(step, opening(*before), opening(*after))
    lead = Quintic.of(step, _lead(*before), _lead(*after))
    side = jnp.sign(after[0].theta_2)
    upright = Quintic.of(step, uprightness(*before, side), uprightness(*after, side))
    outside = upright.control[-1] <= 0.0
    begins_on_section = begins_on_section | (jnp.abs(foot.control[0]) <= _ON_SECTION)
    root = jnp.sqrt(rtol)
    off, known = _INTERPOLATED * root * jnp.sqrt(root) * length**6, _RESOLVED * rtol
    width = jnp.maximum(off, known)
    several, perhaps = _turns(foot, width, begins_on_section)
    falls_and_rises, tilts = _turns(upright, width, jnp.zeros_like(outside))
    above = jnp.where(begins_on_section, foot.control[1], foot.control[0]) > 0.0
    comes_down = above & (foot.control[-1] <= 0.0)
    place = select(outside, upright, foot).root()
    _, slope, curvature = foot.derivatives(place)
    ahead, _, _ = lead.derivatives(place)
    # So near to where it turns, or to both legs in line, that it may not come down at all.
    barely = slope * slope <= 2.0 * width * jnp.abs(curvature)
    barely = barely | (jnp.abs(ahead) <= 2.0 * width)
    leads = functools.reduce(jnp.maximum, lead.control) > -width
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
    """

    near: Scalar
    rest: Scalar
    state: RigidState


def euler_step_onto(falling: Scalar, trial: RigidState, rates: Rates, rtol: Scalar) -> StepOnto:
    """From a trial with these rates, roughly, onto a fall where it is `falling`, else a strike."""
    fall = uprightness(trial, rates, jnp.sign(trial.theta_2))
    surface = select(falling, fall, opening(trial, rates))
    rest = -surface.value / jnp.where(surface.rate == 0.0, 1.0, surface.rate)
    near = jnp.abs(surface.value) <= NEAR * jnp.sqrt(rtol)
    near = near & (surface.rate < 0.0)
    near = near & (jnp.abs(surface.curvature) * rest * rest <= 0.4 * NEAR * rtol)
    return StepOnto(near, rest, advance(trial, rest, [1.0], [rates]))


def _turns(course: Quintic, width: Scalar, from_second: Scalar) -> tuple[Scalar, Scalar]:
    """Whether it changes sign more than once, and whether it may, being known to a width."""
    high = course.sign_changes(width, from_second=from_second)
    low = course.sign_changes(-width, from_second=from_second)
    return jnp.minimum(high, low) > 1, jnp.maximum(high, low) > 1


def _lead(state: RigidState, rates: tuple[Scalar, ...]) -> Surface:
    """How far the swing leg is ahead."""
    return Surface(
        state.theta_1 - state.theta_2, state.omega_1 - state.omega_2, rates[-2] - rates[-1]
    )
