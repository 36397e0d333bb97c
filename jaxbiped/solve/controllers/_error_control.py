"""Error control: the size of a walk's next step from the error estimate of the last attempt.

By the plain law of integral control. Unlike diffrax's own it lets an accepted step be followed by a
smaller one, and a rejected one by none that is larger: where the force has corners, both save
attempts (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, section II.4).
"""

import functools
import operator
from collections.abc import Callable, Sequence
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
_TINY = 1e-30
"""Mean square of errors below which it makes no difference."""
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
        square = self._mean_square(y0, y1_candidate, y_error)
        keep = (square < 1.0) | (span <= _ROUNDING * smallest)
        most = jnp.where(keep & ~controller_state, _MOST, 1.0)
        wanted = SAFETY / _root(jnp.maximum(square, _TINY), error_order)
        factor = jnp.clip(wanted, _LEAST, most).astype(span.dtype)
        size = jax.lax.stop_gradient(jnp.maximum(span * factor, smallest))
        start = jnp.where(keep, t1, t0)
        made_jump = jnp.asarray(False)
        return keep, start, start + size, made_jump, ~keep, diffrax.RESULTS.successful

    def _mean_square(self, y0: PyTree, y1: PyTree, error: PyTree) -> Scalar:
        """Of the errors in units of the tolerance."""

        def scale(before: Scalar, after: Scalar, off: Scalar, inverse: Numbers) -> Scalar:
            largest = jnp.maximum(jnp.abs(before), jnp.abs(after))
            return jnp.asarray(self.atol / inverse + self.rtol * largest, off.dtype)

        scales = jtu.tree_map(scale, y0, y1, error, self.units.inverse)
        errors = jtu.tree_leaves(error)
        quotients = _quotients(errors, jtu.tree_leaves(scales))
        total = sum(jnp.sum(quotient * quotient) for quotient in quotients)
        found = jnp.asarray(total / sum(jnp.size(leaf) for leaf in errors))
        return jnp.where(found < jnp.inf, found, jnp.inf)  # where it is not a number, too


def _quotients(numerators: Sequence[Scalar], denominators: Sequence[Scalar]) -> list[Scalar]:
    """Of pairs of numbers; one division, which takes long, serves several of them."""
    if len({jnp.shape(each) for each in denominators}) > 1:
        together = 1
    else:
        # Products of so many tolerances are still far from the smallest numbers of the type.
        together = 4 if denominators[0].dtype == jnp.float64 else 2
    inverses: list[Scalar] = []
    for first in range(0, len(denominators), together):
        inverses += _inverses(denominators[first : first + together])
    return [a * inverse for a, inverse in zip(numerators, inverses, strict=True)]


def _inverses(numbers: Sequence[Scalar], over_all: Scalar | None = None) -> list[Scalar]:
    """One over each of some numbers, from one over the product of all, by which it divides once."""
    if over_all is None:
        over_all = 1.0 / _product(numbers)
    if len(numbers) == 1:
        return [over_all]
    middle = len(numbers) // 2
    left, right = numbers[:middle], numbers[middle:]
    return [
        *_inverses(left, over_all * _product(right)),
        *_inverses(right, over_all * _product(left)),
    ]


def _product(numbers: Sequence[Scalar]) -> Scalar:
    return functools.reduce(operator.mul, numbers)


def _root(square: Scalar, order: RealScalarLike | None) -> Scalar:
    """The root that a method's order makes of its error; square roots cost less than powers."""
    if order == 4:
        return jnp.sqrt(jnp.sqrt(jnp.sqrt(square)))
    assert order is not None
    return square ** (0.5 / order)
