"""Grazes of a walk that is labelled: a foot touches the ground, or misses it, by a hair.

Whether there was a contact is then open at the tolerance; near a boundary the label may be, too.
"""

import jax.numpy as jnp

from jaxbiped._types import Numbers, Scalar
from jaxbiped.dynamics._feet import Foot, feet
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.solve._fusion_barrier import fusion_barrier
from jaxbiped.solve._step_cubic import StepCubic

_REACH = 2.0
"""Way that a foot can rise in a step, in units of the one at the speed it begins with."""


def grazes(
    scene: CompliantScene, span: Scalar, before: State, after: State, rtol: Numbers
) -> Scalar:
    """Whether a foot's depth turns nearer to zero within a step than it is known to (boolean).

    Args:
        scene: with the ground.
        span: the step's duration [s].
        before, after: states at its ends.
        rtol: relative tolerance; the depth counts as known to that share of the leg's length.
    """
    pairs = list(zip(feet(scene, before), feet(scene, after), strict=True))
    known = rtol * scene.walker.l
    turns = [_turns(span, known, *pair) for pair in pairs]

    def near() -> Scalar:
        found = jnp.zeros_like(span, dtype=bool)
        for (old, new), turning in zip(pairs, turns, strict=True):
            found = found | (turning & (jnp.abs(_extreme(span, old, new)) <= known))
        return found

    either = turns[0] | turns[1]
    return either & fusion_barrier(either, near)


def _turns(span: Scalar, known: Numbers, old: Foot, new: Foot) -> Scalar:
    """Whether a foot that may touch turns within a step, or comes down and may soon (boolean).

    Not one that stands too deep to come near the surface.
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


def _extreme(span: Scalar, old: Foot, new: Foot) -> Scalar:
    """Depth at which a foot turns [m]; of one that came down, had there been no ground.

    A walk may end as a foot comes down, before it turns.
    """
    rates = span * old.penetration_rate, span * new.penetration_rate
    depth = StepCubic(old.penetration, new.penetration, *rates)
    slowed = rates[0] - rates[1]
    further = depth.end + 0.5 * rates[1] ** 2 / jnp.where(slowed == 0.0, 1.0, slowed)
    return jnp.where(depth.turns(), depth.at(depth.turning_point()), further)
