"""Events within a step of a walk that is labelled: arrival at the section, and grazes.

A foot that grazes touches the ground, or misses it, by a hair, and so may a stop. Whether there was
a contact is then open at the tolerance; near a boundary the label may be, too.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp

from jaxbiped._types import Numbers, Scalar
from jaxbiped.dynamics._contacts import Gap, gaps
from jaxbiped.dynamics._footfalls import any_of
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene._state_types import State
from jaxbiped.solve._fusion_barrier import fusion_barrier
from jaxbiped.solve._step_polynomials import StepCubic

_SECANTS = 8
"""By which an arrival is located, to rounding."""
_REACH = 2.0
"""Way that a foot can rise in a step, in units of the one at the speed it begins with."""


def arrival_time(value: Callable[[Scalar], Scalar], low: Scalar, high: Scalar) -> Scalar:
    """Where a function rises through zero between two times [s], by the Illinois method."""

    def secant(_: Scalar, now: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        a, b, at_a, at_b, side, _ = now
        rise = at_b - at_a
        middle = b - at_b * (b - a) / jnp.where(rise == 0.0, 1.0, rise)
        found = value(middle)
        left = found < 0.0
        # An end that stays twice counts half, so that it moves the next time.
        return (
            jnp.where(left, middle, a),
            jnp.where(left, b, middle),
            jnp.where(left, found, jnp.where(side > 0.0, 0.5 * at_a, at_a)),
            jnp.where(left, jnp.where(side < 0.0, 0.5 * at_b, at_b), found),
            jnp.where(left, -1.0, 1.0),
            middle,
        )

    start = (low, high, value(low), value(high), jnp.zeros_like(low), high)
    return jax.lax.fori_loop(0, _SECANTS, secant, start)[-1]


def grazes(
    scene: CompliantScene, span: Scalar, before: State, after: State, rtol: Numbers
) -> Scalar:
    """Whether a gap's depth turns nearer to zero within a step than it is known to (boolean).

    Within the `span` [s] from the state before to that after. The depth of a foot counts as known
    to the share `rtol` of the unit of length, that of a stop to as many radians.
    """
    pairs = list(zip(gaps(scene, before), gaps(scene, after), strict=True))
    feet_of, length = len(scene.mechanism.feet), rtol * scene.mechanism.height
    known = [length if k < feet_of else rtol for k in range(len(pairs))]
    turns = [_turns(span, *each) for each in zip(known, *zip(*pairs, strict=True), strict=True)]

    def near() -> Scalar:
        close = [
            turning & (jnp.abs(_extreme(span, old, new)) <= depth)
            for (old, new), depth, turning in zip(pairs, known, turns, strict=True)
        ]
        return any_of(close)

    turning = any_of(turns)
    return turning & fusion_barrier(turning, near)


def _turns(span: Scalar, known: Numbers, old: Gap, new: Gap) -> Scalar:
    """Whether a gap that may close turns within a step, or closes and may soon (boolean).

    Not one that is too deep to come near its surface.
    """
    turning = jnp.asarray(old.penetration_rate * new.penetration_rate < 0.0)
    lands = (old.penetration <= 0.0) & (new.penetration > 0.0)
    turning = turning | (lands & (old.penetration_rate > new.penetration_rate))
    rises = _REACH * span * jnp.abs(old.penetration_rate)
    turning = turning & (old.penetration <= rises + known)
    if old.admitted is False:
        return jnp.zeros_like(turning)
    if old.admitted is None or new.admitted is None:
        return turning
    return turning & old.admitted & new.admitted


def _extreme(span: Scalar, old: Gap, new: Gap) -> Scalar:
    """Depth at which a gap turns; of one that closed, had there been nothing to press on.

    A walk may end as a foot comes down, before it turns.
    """
    rates = span * old.penetration_rate, span * new.penetration_rate
    depth = StepCubic(old.penetration, new.penetration, *rates)
    slowed = rates[0] - rates[1]
    further = depth.end + 0.5 * rates[1] ** 2 / jnp.where(slowed == 0.0, 1.0, slowed)
    return jnp.where(depth.turns(), depth.at(depth.turning_point()), further)
