"""Grazing: a switch that a motion touches, or misses, by less than it is known to.

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

from jaxbiped._types import Scalar
from jaxbiped.dynamics._switches import Switch
from jaxbiped.solve._fusion_barrier import fusion_barrier
from jaxbiped.solve._step_polynomials import StepCubic

ROUNDING = 1e-15
"""Value of a switch [SI units] that it may have by rounding alone."""


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
    return jnp.asarray(old.live & (old.value > ROUNDING if old.resets else new.live))


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
