"""A step-size controller that also counts footsteps and ends the solve after enough of them."""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._feet import Feet, feet, touches
from jaxbiped.dynamics._state import State


def strikes(before: Feet, after: Feet, last: Scalar) -> tuple[Scalar, Scalar]:
    """Whether each foot makes a heel strike between two moments (booleans).

    A heel strike is the foot ahead coming to touch, when the other one struck last. `last` is the
    foot that did (1 or 2; 0 where none has).
    """

    def lands(i: int) -> Scalar:
        ahead = after[i].x > after[1 - i].x
        return ~touches(before[i]) & touches(after[i]) & ahead & (last != i + 1)

    return lands(0), lands(1)


class FootstepLimit(diffrax.AbstractAdaptiveStepSizeController):
    """Wraps a controller; ends the solve at the end of the step with the last heel strike.

    Its state carries what no function of the walker's state can tell: which foot struck last, and
    how many strikes there were. The solve's `args` must be the scene.

    Attributes:
        controller: decides every step's size.
        limit: number of heel strikes after which the solve ends.
    """

    controller: diffrax.PIDController
    limit: int = eqx.field(static=True)

    @property
    def rtol(self) -> Any:
        return self.controller.rtol

    @property
    def atol(self) -> Any:
        return self.controller.atol

    @property
    def norm(self) -> Callable[[PyTree], Any]:
        return self.controller.norm

    def wrap(self, direction: Any) -> "FootstepLimit":
        return FootstepLimit(self.controller.wrap(direction), self.limit)

    def init(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: State,
        dt0: Any,
        args: Any,
        func: Any,
        error_order: Any,
    ) -> tuple[Any, Any]:
        first, inner = self.controller.init(terms, t0, t1, y0, dt0, args, func, error_order)
        foot_1, foot_2 = feet(args, y0)
        alone_1 = touches(foot_1) & ~touches(foot_2)
        alone_2 = touches(foot_2) & ~touches(foot_1)
        last = jnp.where(alone_1, 1, jnp.where(alone_2, 2, 0))
        return first, (inner, last, jnp.zeros_like(last))

    def adapt_step_size(
        self,
        t0: Any,
        t1: Any,
        y0: State,
        y1_candidate: State,
        args: Any,
        y_error: Any,
        error_order: Any,
        controller_state: Any,
    ) -> tuple[Any, Any, Any, Any, Any, diffrax.RESULTS]:
        inner, last, count = controller_state
        keep, next_t0, next_t1, made_jump, inner, result = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, inner
        )
        strike_1, strike_2 = strikes(feet(args, y0), feet(args, y1_candidate), last)
        strike_1, strike_2 = keep & strike_1, keep & strike_2
        last = jnp.where(strike_1, 1, jnp.where(strike_2, 2, last))
        count = count + jnp.where(strike_1 | strike_2, 1, 0)
        done = diffrax.RESULTS.where(
            count >= self.limit, diffrax.RESULTS.event_occurred, diffrax.RESULTS.successful
        )
        result = diffrax.RESULTS.where(result == diffrax.RESULTS.successful, done, result)
        return keep, next_t0, next_t1, made_jump, (inner, last, count), result
