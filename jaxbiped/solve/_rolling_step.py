"""Rolling step: single support of the rigid walker by Dormand and Prince's method of order 8.

Heel strikes and falls within it are located on its interpolant. A heel strike is where the opening
falls through zero while the swing foot is ahead. Both are asked at the root: a leg that swings back
fast has struck and is behind again by the end of a step.
"""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._stance_motion import rolling_rates
from jaxbiped.dynamics._strike_surfaces import (
    Surface,
    lead,
    lean,
    opening,
    surface_along,
    uprightness,
)
from jaxbiped.scene._scene import RigidScene
from jaxbiped.solve._mode_steps import ModeEvents
from jaxbiped.solve._step_polynomials import Quintic

_TABLEAU = diffrax.Dopri8.tableau
_STAGES = np.zeros((len(_TABLEAU.a_lower) - 1, len(_TABLEAU.a_lower)))
for _row, _weights in zip(_STAGES, _TABLEAU.a_lower[:-1], strict=True):
    _row[: len(_weights)] = _weights
Rates = tuple[Scalar, ...]
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
    state: Any,
    at_start: tuple[Scalar, ...],
    step: Scalar,
    rtol: Scalar,
    *,
    embedded: bool = False,
) -> tuple[Any, Scalar, Rates]:
    """The state a step further, its error in units of the tolerance, and its rates, roughly.

    `at_start` are the angular accelerations at the start. The place along the slope stays. Of the
    error, the root mean square over the components; infinite where it is no number. `embedded`:
    whether to go on with the embedded solution of order 7, by which the error is estimated: another
    method of steps, which a witness of errors takes.
    """
    count = len(at_start)
    turning = slice(1 + count, 1 + 2 * count)
    found = jnp.stack([*state[turning], *at_start])
    found = jnp.pad(found[None], ((0, len(_STAGES)), (0, 0)))

    def stage(found: Scalar, each: Any) -> tuple[Scalar, None]:
        row, here = each
        at = advance(state, step, list(row), [tuple(rates) for rates in found])
        rates = jnp.stack([*at[turning], *rolling_rates(scene, at)])
        return jnp.where(here[:, None], rates, found), None

    # A loop, which XLA compiles once; lanes write it out, without what is multiplied by zero.
    here = np.eye(len(_STAGES) + 1, dtype=bool)[1:]
    found, _ = jax.lax.scan(stage, found, (_STAGES.astype(found.dtype), here))
    stages: list[Rates] = [tuple(row) for row in found]
    weights = _TABLEAU.b_sol - _TABLEAU.b_error if embedded else _TABLEAU.b_sol
    end = advance(state, step, weights[:-1], stages)
    share = jnp.zeros_like(step)
    ends = list(zip(state[1 : 1 + 2 * count], end[1 : 1 + 2 * count], strict=True))
    for i, (a, b) in enumerate(ends):
        error = step * _weighted(_TABLEAU.b_error[:-1], stages, i)
        size = rtol * (0.01 + jnp.maximum(jnp.abs(a), jnp.abs(b)))
        share = share + (error / size) ** 2
    error = jnp.sqrt(share / len(ends))
    return end, jnp.where(jnp.isnan(error), jnp.inf, error), stages[-1]


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
) -> StepEvents:
    """What happens within a step.

    Args:
        scene: what walks.
        step: its length [s].
        before, after: states at both ends, and rates there that end with the accelerations.
        rtol: relative tolerance.
        length: its length in units of the one whose error is the tolerance.
        begins_on_section: whether it begins with a heel strike (boolean).
    """

    def course(function: Callable[[RigidScene, Any], Scalar]) -> Quintic:
        return Quintic.of(step, _along(scene, function, *before), _along(scene, function, *after))

    foot, front = course(opening), course(lead)
    side = jnp.sign(lean(scene, after[0]))
    upright = course(functools.partial(uprightness, side=side))
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
    near = jnp.abs(surface.value) <= NEAR * jnp.sqrt(rtol)
    near = near & (surface.rate < 0.0)
    near = near & (jnp.abs(surface.curvature) * rest * rest <= 0.4 * NEAR * rtol)
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
