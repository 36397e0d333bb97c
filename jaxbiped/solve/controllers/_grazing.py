"""Grazing: a switch, or the ground, that a motion touches or misses by less than it is known to.

Whether there was a contact is then open, and derivatives differ on both sides: a motion that is a
little deeper meets forces that the other does not.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Numbers, Scalar, any_of
from jaxbiped.compiler import fusion_barrier
from jaxbiped.hybrid._guards import Gap, Switch
from jaxbiped.solve._step_polynomials import StepCubic

ROUNDING = 1e-15
"""Value of a switch [SI units] that it may have by rounding alone."""
_REACH = 2.0
"""Way that a foot can rise in a step, in units of the one at the speed it begins with."""


class Turns(NamedTuple):
    """Where switches turn between the ends of a step.

    Attributes:
        touches: which ones may reach zero there and turn back, so that the step has to end there
            (booleans), shape (k,).
        places: the part of the step that lies before, shape (k,).
        graze: whether one turns so near zero that derivatives are not determined (boolean).
    """

    touches: Scalar
    places: Scalar
    graze: Scalar


def _may_turn(old: Switch, new: Switch) -> Scalar:
    """Whether it matters how a switch turns; one that resets the state may have begun on it."""
    if not old.resets:
        return jnp.asarray(old.live & new.live)
    begins_off = old.value > ROUNDING
    if old.rises:
        begins_off = begins_off | (old.value <= 0.0)
    return jnp.asarray(old.live & begins_off)


def turns_of(
    rates: Callable[[PyTree], PyTree],
    switches: Callable[[PyTree], tuple[Switch, ...]],
    span: Scalar,
    before: PyTree,
    after: PyTree,
    errors: PyTree,
) -> Turns:
    """The turns of k switches within a step.

    Args:
        rates: the field at a state.
        switches: the switches at a state.
        span: the step's duration [s].
        before, after: states at its ends.
        errors: that a state may have.
    """

    def values(y: PyTree) -> Scalar:
        return jnp.stack([switch.value for switch in switches(y)])

    ends: list[Scalar] = []
    for state in (before, after):
        value, slope = jax.jvp(values, (state,), (rates(state),))
        ends += [value, span * slope]
    cubic = StepCubic(ends[0], ends[2], ends[1], ends[3])
    both = list(zip(switches(before), switches(after), strict=True))
    live = jnp.stack([_may_turn(old, new) for old, new in both])
    corner = np.array([switch.corner for switch, _ in both])
    places, turning = cubic.turning_point(), cubic.turns() & live & ~corner
    leaves, structure = jtu.tree_flatten(after)

    def graze() -> Scalar:
        normals = jax.jacfwd(lambda y: values(jtu.tree_unflatten(structure, y)))(leaves)
        known_to = jnp.zeros_like(cubic.start)
        for normal, error in zip(normals, jtu.tree_leaves(errors), strict=True):
            known_to = known_to + jnp.abs(normal) * error
        return jnp.any(turning & (jnp.abs(cubic.at(places)) <= known_to))

    turns = jnp.any(turning)
    return Turns(live & cubic.may_touch(), places, turns & fusion_barrier(turns, graze))


def grazes(
    old_gaps: tuple[Gap, ...], new_gaps: tuple[Gap, ...], span: Scalar, rtol: Numbers
) -> Scalar:
    """Whether a gap's depth turns nearer to zero within a step than it is known to (boolean).

    Within the `span` [s] from the old gaps to the new ones. A depth counts as known to the share
    `rtol` of the gap's size.
    """
    pairs = list(zip(old_gaps, new_gaps, strict=True))
    known = [rtol * gap.size for gap in old_gaps]
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
