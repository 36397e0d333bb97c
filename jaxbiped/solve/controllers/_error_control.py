"""Error control: the size of a walk's next step from the error estimate of the last attempt.

By the plain law of integral control. Unlike diffrax's own it lets an accepted step be followed by a
smaller one, and a rejected one by none that is larger: where the force has corners, both save
attempts (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, section II.4).
"""

from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Numbers, RealScalarLike, Scalar, Time
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve._units import Units
from jaxbiped.solve.controllers._step_control import SAFETY, SMALLEST_STEP
from jaxbiped.solve.controllers._wrapped_control import AbstractControl, Adapted

_LEAST, _MOST = 0.2, 10.0
"""Sizes of the next step, in units of the last attempt."""
_TINY = 1e-20
"""Error below which it makes no difference."""
_RESOLUTION = 8.9e-16
"""Smallest step, in units of the time that has passed: four roundings of 64 bits. In 32 bits such
a step stands still and runs out of attempts, as it should."""
_ROUNDING = 1.01
"""Times the smallest step that counts as it."""


class ErrorControl(AbstractControl):  # type: ignore[type-arg]
    """Keeps steps whose error is below the tolerance; its state is whether the last was rejected.

    The solve's first step must be given.

    Attributes:
        rtol, atol: tolerances; the absolute one in units of each leaf.
        units: of the state's leaves and of time.
    """

    rtol: RealScalarLike
    atol: RealScalarLike
    units: Units

    @property
    def norm(self) -> Callable[[PyTree], RealScalarLike]:
        """Of errors in units of the tolerance."""
        return rms_norm

    def wrap(self, direction: RealScalarLike) -> "ErrorControl":
        """As diffrax asks; walks are never solved backwards."""
        return self

    def init(
        self, terms: Any, t0: Time, t1: Time, y0: PyTree, dt0: Scalar, *rest: Any
    ) -> tuple[Scalar, Scalar]:
        """The first step's end and the controller's state, as diffrax asks."""
        return jnp.asarray(t0 + dt0), jnp.asarray(False)

    def adapt_step_size(
        self,
        t0: Time,
        t1: Time,
        y0: PyTree,
        y1_candidate: PyTree,
        args: PyTree,
        y_error: PyTree,
        error_order: RealScalarLike | None,
        controller_state: Scalar,
    ) -> Adapted:
        """Accepts or rejects a step, as diffrax asks."""
        span = jnp.asarray(t1 - t0)
        # A state that is no longer a number ends the solve in another way than by small steps.
        smallest = jnp.maximum(
            SMALLEST_STEP * jnp.asarray(self.units.time, span.dtype),
            _RESOLUTION * jnp.abs(t1),
        )
        error = self._error(y0, y1_candidate, y_error)
        keep = (error < 1.0) | (span <= _ROUNDING * smallest)
        most = jnp.where(keep & ~controller_state, _MOST, 1.0)
        wanted = SAFETY / _root(jnp.maximum(error, _TINY), error_order)
        factor = jnp.clip(wanted, _LEAST, most).astype(span.dtype)
        size = jax.lax.stop_gradient(jnp.maximum(span * factor, smallest))
        start = jnp.where(keep, t1, t0)
        made_jump = jnp.asarray(False)
        return keep, start, start + size, made_jump, ~keep, diffrax.RESULTS.successful

    def _error(self, y0: PyTree, y1: PyTree, error: PyTree) -> Scalar:
        def scaled(before: Scalar, after: Scalar, off: Scalar, inverse: Numbers) -> Scalar:
            largest = jnp.maximum(jnp.abs(before), jnp.abs(after))
            return off / (self.atol / inverse + self.rtol * largest).astype(off.dtype)

        found = self.norm(jtu.tree_map(scaled, y0, y1, error, self.units.inverse))
        return jnp.where(found < jnp.inf, found, jnp.inf)  # where it is not a number, too


def _root(error: Scalar, order: RealScalarLike | None) -> Scalar:
    """The root that a method's order makes of its error; square roots cost less than powers."""
    if order == 4:
        return jnp.sqrt(jnp.sqrt(error))
    assert order is not None
    return error ** (1.0 / order)
