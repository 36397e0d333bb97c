"""Step size, from the error estimate of the last attempt: of walks, and with derivatives.

A walk's is the same for every engine. The law is plain integral control. Unlike diffrax's, it
allows a smaller step after an accepted one, and no larger step after a rejected one. If the force
has corners, both save attempts (Hairer, Nørsett and Wanner, Solving Ordinary Differential
Equations I, section II.4). A step in which the contact changes its kind must be more accurate,
because the embedded estimate of some methods hardly sees a corner of the force that a step crosses.
"""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any, cast

import diffrax
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Numbers, RealScalarLike, Scalar
from jaxbiped.hybrid._scales import Units
from jaxbiped.hybrid._system import AbstractSystem
from jaxbiped.solve._accuracy import rms_norm
from jaxbiped.solve.controllers._event_steps import ShallowContact, TouchdownAhead
from jaxbiped.solve.controllers._wrapped_control import (
    AbstractControl,
    AbstractMemorylessControl,
    Adapted,
    Attempt,
    StepControl,
)

SAFETY = 0.8
"""Of the step size that the error estimate allows. At diffrax's 0.9 the contact's switches reject
so many steps that the same error takes more of them."""
SMALLEST_STEP = 1e-12
"""Step size, in units of time, that is taken whatever its error: how a jump of the force is
crossed."""
_LEAST, _MOST = 0.2, 10.0
"""Sizes of the next step, in units of the last attempt."""
_TINY = 1e-30
"""Mean square of errors below which it makes no difference."""
_RESOLUTION = 8.9e-16
"""Smallest step, in units of the time that has passed: four roundings of 64 bits. In 32 bits such
a step stands still and runs out of attempts, as it should."""
_ROUNDING = 1.01
"""Times the smallest step that counts as it."""
_WILD = 1e3
"""Of each leaf of the state, in its unit: no step of a walk changes one by as much."""


def walk_control(
    rtol: RealScalarLike,
    atol: RealScalarLike,
    units: Units,
    system: AbstractSystem,
    *,
    switch_weight: float = 1.0,
    probe: PyTree = None,
) -> StepControl:
    """The controller of a walk's steps; the solve's `args` must be the scene.

    Args:
        rtol, atol: tolerances; the absolute one in units of each leaf.
        units: units of the state's leaves and of time.
        system: what moves.
        switch_weight: factor of the errors of steps that cross a switch.
        probe: as of `CrossedSwitches`.
    """
    control: StepControl = ErrorControl(rtol, atol, units)
    if switch_weight != 1.0:
        control = CrossedSwitches(control, system, switch_weight, probe)
    return ShallowContact(TouchdownAhead(control, system), system)


class ErrorControl(AbstractControl):
    """Keeps steps with an error below the tolerance; its state is whether the last was rejected.

    The solve's first step must be given.

    Attributes:
        rtol, atol: tolerances; the absolute one in units of each leaf.
        units: units of the state's leaves and of time.
    """

    rtol: RealScalarLike
    atol: RealScalarLike
    units: Units

    @property
    def norm(self) -> Callable[[PyTree], RealScalarLike]:
        """Norm of errors in units of the tolerance."""
        return rms_norm

    def init(self, *request: Any) -> tuple[Scalar, Scalar]:
        _, t0, _, _, dt0, *_ = request
        return jnp.asarray(t0 + dt0), jnp.asarray(False)

    def adapt(self, attempt: Attempt) -> Adapted:
        t0, t1, rejected = attempt.t0, attempt.t1, attempt.memory
        span = jnp.asarray(t1 - t0)
        # A state that is no longer a number ends the solve in another way than by small steps.
        smallest = jnp.maximum(
            SMALLEST_STEP * jnp.asarray(self.units.time, span.dtype),
            _RESOLUTION * jnp.abs(t1),
        )
        square = self._mean_square(attempt.y0, attempt.y1, attempt.error)
        keep = (square < 1.0) | (span <= _ROUNDING * smallest)
        most = jnp.where(keep & ~rejected, _MOST, 1.0)
        wanted = SAFETY / _root(jnp.maximum(square, _TINY), attempt.order)
        factor = jnp.clip(wanted, _LEAST, most).astype(span.dtype)
        size = jax.lax.stop_gradient(jnp.maximum(span * factor, smallest))
        start = jnp.where(keep, t1, t0)
        jump = jnp.asarray(False)
        return Adapted(keep, start, start + size, jump, ~keep, diffrax.RESULTS.successful)

    def _mean_square(self, y0: PyTree, y1: PyTree, error: PyTree) -> Scalar:
        """Of the errors in units of the tolerance."""

        def scale(before: Scalar, after: Scalar, off: Scalar, inverse: Numbers) -> Scalar:
            # A state that runs away within a step must not make its own error look small.
            largest = jnp.maximum(jnp.abs(before), jnp.minimum(jnp.abs(after), _WILD / inverse))
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
        over_all = 1.0 / functools.reduce(operator.mul, numbers)
    if len(numbers) == 1:
        return [over_all]
    middle = len(numbers) // 2
    left, right = numbers[:middle], numbers[middle:]
    return [
        *_inverses(left, over_all * functools.reduce(operator.mul, right)),
        *_inverses(right, over_all * functools.reduce(operator.mul, left)),
    ]


def _root(square: Scalar, order: RealScalarLike | None) -> Scalar:
    """The root that a method's order makes of its error; square roots cost less than powers."""
    if order == 4:
        return jnp.sqrt(jnp.sqrt(jnp.sqrt(square)))
    assert order is not None
    return square ** (0.5 / order)


class CrossedSwitches(AbstractMemorylessControl):
    """Wraps a controller; errors of steps that cross a switch of the contact count `weight` times.

    Attributes:
        system: what moves.
        weight: factor of those errors [–].
        probe: a state as close to the step's end as its error, whose contacts cost less; None if
            there is no such state.
    """

    system: AbstractSystem
    weight: float
    probe: PyTree = None

    def adapt(self, attempt: Attempt) -> Adapted:
        end = attempt.y1 if self.probe is None else self.probe
        crosses = self.system.contact_changes(attempt.args, attempt.y0, end)
        factor = jnp.where(crosses, self.weight, 1.0)
        error = jtu.tree_map(lambda leaf: leaf * factor.astype(leaf.dtype), attempt.error)
        return attempt.by(self.controller, error=error)


def step_control(
    rtol: RealScalarLike,
    atol: RealScalarLike,
    norm: Callable[[PyTree], Scalar],
    units: Units | None = None,
) -> StepControl:
    """The controller of solves that carry derivatives: diffrax's; `norm` measures the errors.

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
