"""Given first step: a step-size controller that brings the first step's size itself.

diffrax checks a size that it is given by a call back to Python, and a program with such a call
cannot be kept on disk. Sizes are checked before a solve begins.
"""

from typing import Any

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, Time
from jaxbiped.solve.controllers._wrapped_control import AbstractWrappedControl, Adapted, StepControl


class GivenFirstStep(AbstractWrappedControl):
    """Wraps a controller; the solve's own `dt0` is None.

    Attributes:
        controller: decides every step's size but the first's.
        size: of the first step, or of all where the controller keeps it [s].
    """

    controller: StepControl
    size: RealScalarLike

    def init(
        self, terms: Any, t0: Time, t1: Time, y0: PyTree, dt0: Scalar | None, *rest: Any
    ) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""
        size = jnp.asarray(self.size, dtype=jnp.result_type(t0))
        return self.controller.init(terms, t0, t1, y0, size, *rest)

    def adapt_step_size(self, *step: Any) -> Adapted:
        """Accepts or rejects a step as the wrapped controller does."""
        return self.controller.adapt_step_size(*step)
