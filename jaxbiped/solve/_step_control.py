"""How steps are chosen: what every solve of the project has in common."""

from collections.abc import Callable
from typing import Any

import diffrax
import jax.numpy as jnp

from jaxbiped._types import Scalar

_FIRST_STEP = 1e-5
"""First step tried [s]; a start that is not a number must not choose it."""
_SMALLEST_STEP = 1e-12
"""Step size [s] that is taken whatever its error: how a jump of the force is crossed."""
_SAFETY = 0.8
"""Of the step size that the error estimate allows. At diffrax's 0.9 the contact's switches reject
so many steps that the same error takes more of them."""


def step_control(rtol: Any, atol: Any, norm: Callable[[Any], Any]) -> diffrax.PIDController:
    """The controller of step sizes for these tolerances, errors measured by `norm`."""
    return diffrax.PIDController(
        rtol=rtol,
        atol=atol,
        norm=norm,
        dtmin=_SMALLEST_STEP,
        safety=_SAFETY,
        force_dtmin=True,  # a state that is no longer a number ends the solve in another way
    )


def first_step(duration: Scalar) -> Scalar:
    """The first step to try [s] in a solve of at most `duration` [s]."""
    return jnp.minimum(jnp.full_like(duration, _FIRST_STEP), duration)
