"""Step size of solves that carry derivatives with the state: how diffrax chooses it."""

from collections.abc import Callable
from typing import cast

import diffrax
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar
from jaxbiped.solve._units import Units
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractMemorylessControl,
    Adapted,
    Attempt,
    StepControl,
)

SMALLEST_STEP = 1e-12
"""Step size, in units of time, that is taken whatever its error: how a jump of the force is
crossed."""
SAFETY = 0.8
"""Of the step size that the error estimate allows. At diffrax's 0.9 the contact's switches reject
so many steps that the same error takes more of them."""


def step_control(
    rtol: RealScalarLike,
    atol: RealScalarLike,
    norm: Callable[[PyTree], Scalar],
    units: Units | None = None,
) -> StepControl:
    """The step-size controller for these tolerances; `norm` measures the errors.

    Args:
        rtol, atol: tolerances; the absolute one in units of each leaf.
        norm: norm of the errors in units of the tolerance.
        units: units of the state's leaves and of time. Default: SI.
    """
    time = 1.0 if units is None else units.time
    control = diffrax.PIDController(
        rtol=rtol,
        atol=atol,
        norm=norm,
        dtmin=SMALLEST_STEP * time,
        safety=SAFETY,
        force_dtmin=True,  # a state that is no longer a number ends the solve in another way
    )
    found = cast(StepControl, control)
    return found if units is None else InUnits(found, units.inverse)


class InUnits(AbstractMemorylessControl):
    """Wraps a controller; shows it states and errors in units of their own.

    Attributes:
        inverse: reciprocal of the unit of each leaf of the state.
    """

    inverse: PyTree

    def adapt(self, attempt: Attempt) -> Adapted:
        before, after, error = (
            jtu.tree_map(lambda leaf, inverse: leaf * inverse, y, self.inverse)
            for y in (attempt.y0, attempt.y1, attempt.error)
        )
        return attempt.by(self.controller, y0=before, y1=after, error=error)
