"""Footstep limit: a step-size controller that ends the solve after enough footsteps."""

from collections.abc import Callable
from typing import Any

import diffrax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, Time
from jaxbiped.dynamics._feet import feet, landings, standing_foot
from jaxbiped.dynamics._state import State
from jaxbiped.solve.controllers._wrapped_control import AbstractWrappedControl, Adapted, StepControl

PATIENCE = 100.0
"""Time allowed for each footstep asked for [s]."""


class FootstepLimit(AbstractWrappedControl):
    """Wraps a controller; ends the solve at the end of the step with the last heel strike.

    Its state carries what no function of the walker's state can tell: which foot struck last, and
    how many strikes there were. The solve's `args` must be the scene.

    Attributes:
        controller: decides every step's size.
        limit: number of heel strikes after which the solve ends.
    """

    controller: StepControl
    limit: RealScalarLike

    def init(
        self,
        terms: Any,
        t0: Time,
        t1: Time,
        y0: State,
        dt0: Scalar | None,
        args: PyTree,
        func: Callable[..., PyTree],
        error_order: RealScalarLike | None,
    ) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""
        first, inner = self.controller.init(terms, t0, t1, y0, dt0, args, func, error_order)
        last = standing_foot(feet(args, y0))
        return first, (inner, last, jnp.zeros_like(last))

    def adapt_step_size(
        self,
        t0: Time,
        t1: Time,
        y0: State,
        y1_candidate: State,
        args: PyTree,
        y_error: PyTree,
        error_order: RealScalarLike | None,
        controller_state: Any,
    ) -> Adapted:
        """Accepts or rejects a step as the wrapped controller does, and counts."""
        inner, last, count = controller_state
        keep, next_t0, next_t1, made_jump, inner, result = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, inner
        )
        lands_1, lands_2 = landings(feet(args, y0), feet(args, y1_candidate))
        strike_1, strike_2 = keep & lands_1 & (last != 1), keep & lands_2 & (last != 2)
        last = jnp.where(strike_1, 1, jnp.where(strike_2, 2, last))
        count = count + jnp.where(strike_1 | strike_2, 1, 0)
        done = diffrax.RESULTS.where(
            count >= self.limit, diffrax.RESULTS.event_occurred, diffrax.RESULTS.successful
        )
        result = diffrax.RESULTS.where(result == diffrax.RESULTS.successful, done, result)
        return keep, next_t0, next_t1, made_jump, (inner, last, count), result
