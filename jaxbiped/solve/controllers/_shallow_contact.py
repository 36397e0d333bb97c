"""Shallow contact: a step that would step over one ends just past its beginning instead.

A foot that is off the ground at both ends of a step may touch it in between, and one that is barely
in it at an end may have been deeper. No error estimate sees that where no stage of the step feels
its force.
"""

import functools
from typing import Any, cast

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, Time
from jaxbiped.dynamics._feet import Foot, feet
from jaxbiped.solve._fusion_barrier import fusion_barrier
from jaxbiped.solve._step_cubic import StepCubic
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractWrappedControl,
    Adapted,
    StepControl,
    try_again,
)

_OVERSHOOT = 5e-5
"""Part of the way to the ground that a step ends past it."""
_MARGIN = 1e-12
"""Time that it does besides [s]."""
_BARELY = 1e-2
"""Depth and speed in the ground at a step's end, in units of height and speed at its beginning,
below which a contact is shallow."""
_BARELY_WHERE_KEPT = 0.1
"""That depth where the step would be kept."""
_ALL = 0.999
"""Part of a step that is as good as all of it."""
_REACH = 2.0
"""Way that a foot can sink or rise in a step, in units of the one at the speed it begins with."""


class ShallowContact(AbstractWrappedControl):
    """Wraps a controller; a step within which a foot dips into the ground is tried again, to there.

    The solve's `args` must be the scene.

    Attributes:
        controller: decides every step's size.
    """

    controller: StepControl

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""
        return self.controller.init(*request)

    def adapt_step_size(
        self,
        t0: Time,
        t1: Time,
        y0: PyTree,
        y1_candidate: PyTree,
        args: PyTree,
        y_error: PyTree,
        error_order: RealScalarLike | None,
        controller_state: Any,
    ) -> Adapted:
        """Accepts or rejects a step as the wrapped controller does, but for shallow contacts."""
        adapted = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, controller_state
        )
        keep, _, _, jump, _, result = adapted
        start, span = cast(Scalar, t0), cast(Scalar, t1 - t0)
        found = _touchdown(args, start, span, keep, y0, y1_candidate)
        again, target = jax.lax.stop_gradient(found)
        keep, next_t0, next_t1, inner = try_again(again, target, t0, adapted, controller_state)
        return keep, next_t0, next_t1, jump, inner, result


def _touchdown(
    scene: PyTree, t0: Scalar, span: Scalar, keep: Scalar, y0: PyTree, y1: PyTree
) -> tuple[Scalar, Scalar]:
    """Whether a step, which is to be kept or not, is to end at a contact instead, and when [s]."""
    part = jnp.ones_like(span)
    for k, before in enumerate(feet(scene, y0)):
        if before.admitted is False:
            continue
        near = jnp.abs(before.penetration) < _REACH * span * before.penetration_rate
        near = near if before.admitted is None else near & before.admitted
        above = functools.partial(_part_above, scene, span, keep, k, before, y1)
        part = jnp.minimum(part, jnp.where(near, fusion_barrier(near, above), 1.0))
    target = t0 + span * part * (1.0 + _OVERSHOOT) + _MARGIN
    return (part < _ALL) & (target < t0 + span), target


def _part_above(
    scene: PyTree, span: Scalar, keep: Scalar, k: int, before: Foot, y1: PyTree
) -> Scalar:
    """The part of a step after which a foot comes into the ground, barely; 1 if it does not.

    Or that after which it is lowest, where it may come into the ground. A step that is tried again
    to there ends in the air, or in the ground at no speed: then the contact has begun before. So it
    has where the foot is on its way out of the ground, and a damper's force is over by then. Or the
    part after which a foot is deepest that begins barely in the ground and ends out of it: a smooth
    force is not felt yet where the step begins. Of a step that is not kept the end tells nothing.
    """
    after = feet(scene, y1)[k]
    rates = span * before.penetration_rate, span * after.penetration_rate
    depth = StepCubic(before.penetration, after.penetration, *rates)
    off, rises = depth.start <= 0.0, keep & (depth.end_slope < 0.0)
    brief = ~off & (depth.start_slope > 0.0) & (depth.end <= 0.0) & rises
    if before.admitted is not None and after.admitted is not None:
        admitted = before.admitted & after.admitted
        off, brief = off & admitted, brief & admitted
    leaves = off & (depth.end <= 0.0) & depth.may_touch()
    slow = jnp.abs(depth.end_slope) < _BARELY * depth.start_slope
    barely = slow & (depth.end < -jnp.where(keep, _BARELY_WHERE_KEPT, _BARELY) * depth.start)
    stays = off & (depth.end > 0.0) & (barely | rises)
    lowest = jnp.where(leaves | brief, depth.turning_point(), 1.0)
    deepest = depth.at(lowest)
    contact = (leaves | stays) & (deepest > 0.0)

    def touchdown() -> Scalar:
        # The same cubic up to there, where it has a sign change to be found.
        slope_there = jnp.where(leaves, 0.0, depth.end_slope)
        down = StepCubic(depth.start, deepest, lowest * depth.start_slope, lowest * slope_there)
        return lowest * down.sign_change()

    return jnp.where(contact, fusion_barrier(contact, touchdown), lowest)
