"""Footstep limit: a step-size controller that ends the solve after enough footsteps."""

from typing import Any

import diffrax
import jax.numpy as jnp

from jaxbiped._types import RealScalarLike, Scalar
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._footfalls import any_of, landings, standing_leg
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractWrappedControl,
    Adapted,
    Attempt,
)

PATIENCE = 100.0
"""Time allowed for each footstep asked for [s]."""


class FootstepLimit(AbstractWrappedControl):
    """Wraps a controller; ends the solve at the end of the step with the last heel strike.

    Its state carries what cannot be computed from the walker's state: the leg that struck last, and
    the number of strikes. The solve's `args` must be the scene.

    Attributes:
        limit: number of heel strikes after which the solve ends.
    """

    limit: RealScalarLike

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        first, inner = self.controller.init(*request)
        _, _, _, y0, _, args, *_ = request
        last = standing_leg(args.mechanism.structure, feet(args, y0))
        return first, (inner, last, jnp.zeros_like(last))

    def adapt(self, attempt: Attempt) -> Adapted:
        inner, last, count = attempt.memory
        adapted = attempt.by(self.controller, memory=inner)
        structure = attempt.args.mechanism.structure
        before, after = feet(attempt.args, attempt.y0), feet(attempt.args, attempt.y1)
        lands = landings(structure, before, after)
        # Of several legs another one made the strike before; a single leg hops.
        strikes = [
            adapted.keep & landed & (last != leg if len(lands) > 1 else True)
            for leg, landed in enumerate(lands, 1)
        ]
        for leg, strike in reversed(list(enumerate(strikes, 1))):
            last = jnp.where(strike, leg, last)
        count = count + jnp.where(any_of(strikes), 1, 0)
        successful = diffrax.RESULTS.successful
        done = diffrax.RESULTS.where(
            count >= self.limit, diffrax.RESULTS.event_occurred, successful
        )
        result = diffrax.RESULTS.where(adapted.result == successful, done, adapted.result)
        return adapted._replace(memory=(adapted.memory, last, count), result=result)
