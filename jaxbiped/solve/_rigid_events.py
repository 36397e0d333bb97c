"""Heel strikes and falls of the rigid walker within a step, located on its interpolant.

A heel strike is where the opening, the sum of the leg angles, falls through zero while the swing
leg is ahead. Both are asked at the root: a leg that swings back fast has struck and is behind again
by the end of a step.
"""

import functools
from typing import NamedTuple

import jax.numpy as jnp

from jaxbiped._types import Scalar, select
from jaxbiped.dynamics._state import RigidState
from jaxbiped.solve._ending import FALL_ANGLE
from jaxbiped.solve._quintic import Quintic
from jaxbiped.solve._rolling_step import Rates

_INTERPOLATED = 2.0
"""Largest error of the interpolated opening [rad], as measured, over a step whose own error is the
tolerance, in units of rtol^¾."""
_RESOLVED = 1.0
"""Error that an opening may have [rad], in units of rtol."""
_ON_SECTION = 1e-12
"""Opening [rad] up to which a walk begins on the section: its rate tells on which side it is."""


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
