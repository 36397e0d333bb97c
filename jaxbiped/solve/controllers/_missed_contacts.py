"""Missed contacts: counts steps of one size that a foot dips into the ground and leaves within.

Such steps are not cut short: where contacts lie between them, that is told.
"""

from typing import Any

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._feet import Foot, feet
from jaxbiped.solve._step_cubic import StepCubic
from jaxbiped.solve.controllers._wrapped_control import AbstractWrappedControl, Adapted, StepControl


class MissedContacts(AbstractWrappedControl):
    """Wraps a controller; its state carries how many contacts lie between two steps.

    The solve's `args` must be the scene.

    Attributes:
        controller: decides every step's size.
    """

    controller: StepControl

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""
        first, inner = self.controller.init(*request)
        return first, (inner, jnp.zeros((), dtype=jnp.int32))

    def adapt_step_size(
        self, t0: Time, t1: Time, y0: PyTree, y1_candidate: PyTree, args: PyTree, *rest: Any
    ) -> Adapted:
        """Accepts or rejects a step as the wrapped controller does, and counts."""
        *others, (inner, count) = rest
        keep, next_t0, next_t1, jump, inner, result = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, *others, inner
        )
        span = jnp.asarray(t1 - t0)
        before, after = feet(args, y0), feet(args, y1_candidate)
        for k in range(2):
            missed = keep & _misses(span, before[k], after[k])
            count = count + jnp.where(missed, 1, 0).astype(count.dtype)
        return keep, next_t0, next_t1, jump, (inner, count), result


def _misses(span: Scalar, before: Foot, after: Foot) -> Scalar | bool:
    """Whether a foot that is off the ground at both ends is in it in between (boolean).

    By the cubic through depths and rates at both ends.
    """
    if before.admitted is False:
        return False
    rates = span * before.penetration_rate, span * after.penetration_rate
    depth = StepCubic(before.penetration, after.penetration, *rates)
    off = (depth.start <= 0.0) & (depth.end <= 0.0) & (depth.start_slope > 0.0)
    if before.admitted is not None and after.admitted is not None:
        off = off & before.admitted & after.admitted
    return off & depth.turns() & (depth.at(depth.turning_point()) > 0.0)
