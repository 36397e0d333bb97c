"""Step-size controllers that wrap another one, their common base and two plain ones; solves' ends.

diffrax looks for tolerances and norm on the controller it is given, whatever that wraps.
"""

import abc
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Numbers, RealScalarLike, Scalar, Time, by_numpy, select
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.solve._accuracy import rms_norm

if TYPE_CHECKING:  # which takes the adaptive one's abstract attributes for arguments
    from diffrax import AbstractStepSizeController as _Control
else:
    from diffrax import AbstractAdaptiveStepSizeController as _Control


_FIRST_STEP = 1e-5
"""First step tried, in units of time; a start that is not a number must not choose it."""
_CLIPPED_ULPS = 100
"""A step that would end this near the end, in units in the last place, ends there."""
_ALMOST_WHOLE = 1e-6
"""A step that ends this part of its size too soon was not cut short, but rounded."""


class StepControl(Protocol):
    """Interface of a step-size controller; see `diffrax.AbstractStepSizeController`."""

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state."""

    def adapt_step_size(self, *step: Any) -> tuple[Any, ...]:
        """Accepts or rejects a step."""


class Adapted(NamedTuple):
    """A controller's decision on an attempt.

    Attributes:
        keep: whether the step is accepted.
        t0, t1: ends of the next step [s].
        jump: whether a jump was passed.
        memory: the controller's state.
        result: diffrax's result code.
    """

    keep: Scalar
    t0: Scalar
    t1: Scalar
    jump: Scalar
    memory: Any
    result: Any


class Attempt(NamedTuple):
    """An attempted step, as diffrax passes it to a controller.

    Attributes:
        t0, t1: ends of the step [s].
        y0, y1: states at these ends.
        args: arguments of the solve; the scene for a walk.
        error: estimate of the step's error, shaped as a state.
        order: order of the error.
        memory: the controller's state.
    """

    t0: Time
    t1: Time
    y0: PyTree
    y1: PyTree
    args: PyTree
    error: PyTree
    order: RealScalarLike | None
    memory: Any

    def by(self, controller: StepControl, **changes: Any) -> Adapted:
        """A controller's decision on the attempt, with these changes."""
        return Adapted(*controller.adapt_step_size(*self._replace(**changes)))


class AbstractControl(_Control):  # type: ignore[type-arg]
    """Base of this project's controllers, in the form that diffrax takes."""

    @abc.abstractmethod
    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax requires."""

    @abc.abstractmethod
    def adapt(self, attempt: Attempt) -> Adapted:
        """Accepts or rejects a step."""

    def wrap(self, direction: RealScalarLike) -> Self:
        """As diffrax requires; direction has no effect, because no walk is solved backwards."""
        return self

    def adapt_step_size(self, *step: Any) -> Adapted:
        return self.adapt(Attempt(*step))


class EqualSteps(eqx.Module):
    """A `StepControl` of steps of one size. An attempt is in vain whose error is infinite.

    Behind a step that another controller made end sooner, the next one ends where that would have.

    Its state is the number of steps to the end of the next one. As in diffrax, times are multiples
    of the size, rounded once each, but for the first one.

    Attributes:
        count: number of steps to the end of the solve.
        end: that time [s].
    """

    count: RealScalarLike
    end: RealScalarLike

    def init(self, *request: Any) -> tuple[Scalar, Scalar]:
        _, t0, _, _, size, *_ = request
        return jnp.asarray(t0 + size), jnp.ones_like(jnp.asarray(t0))

    def adapt_step_size(self, *step: Any) -> Adapted:
        attempt = Attempt(*step)
        keep = jtu.tree_leaves(attempt.error)[0] < jnp.inf
        is_whole = attempt.t1 >= self._end_of(attempt.memory - _ALMOST_WHOLE)
        steps = attempt.memory + jnp.where(is_whole, 1.0, 0.0)
        until = self._end_of(steps)
        jump, success = jnp.asarray(False), diffrax.RESULTS.successful
        return Adapted(keep, jnp.asarray(attempt.t1), until, jump, steps, success)

    def _end_of(self, steps: Scalar) -> Scalar:
        """The end of the step of a number [s]."""
        return jnp.asarray(self.end * (steps / self.count))


def try_again(attempt: Attempt, adapted: Adapted, again: Scalar, target: Scalar) -> Adapted:
    """The same decision if a step is not tried `again`.

    If it is, the next step ends at the `target` at the latest, and the controller keeps its earlier
    state.
    """
    sooner = jnp.where(adapted.keep, target, jnp.minimum(adapted.t1, target))
    return adapted._replace(
        memory=select(again, attempt.memory, adapted.memory),
        keep=adapted.keep & ~again,
        t0=jnp.where(again, attempt.t0, adapted.t0),
        t1=jnp.where(again, sooner, adapted.t1),
    )


class AbstractWrappedControl(AbstractControl):
    """Leaves every step's size to another controller, and adds behaviour of its own.

    Attributes:
        controller: controller that decides every step's size.
    """

    controller: StepControl

    @property
    def rtol(self) -> RealScalarLike:
        """The wrapped controller's relative tolerance; steps of one size have none."""
        return getattr(self.controller, "rtol", 0.0)

    @property
    def atol(self) -> RealScalarLike:
        """The wrapped controller's absolute tolerance; steps of one size have none."""
        return getattr(self.controller, "atol", 0.0)

    @property
    def norm(self) -> Callable[[PyTree], RealScalarLike]:
        """Norm of errors in units of the tolerance."""
        norm: Callable[[PyTree], RealScalarLike] = getattr(self.controller, "norm", rms_norm)
        return norm


class AbstractMemorylessControl(AbstractWrappedControl):
    """Wraps a controller and carries nothing but that controller's state from step to step."""

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        return self.controller.init(*request)


class Extremes(AbstractWrappedControl):
    """Wraps a controller; keeps the least and largest values at the ends of the accepted steps.

    This is exact for every solver and does not store the steps. The start counts as an end.

    Attributes:
        function: function of (args, state) whose values are compared.
    """

    function: Callable[[PyTree, PyTree], PyTree] = eqx.field(static=True)

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        first, inner = self.controller.init(*request)
        _, _, _, y0, _, args, *_ = request
        value = self.function(args, y0)
        return first, (inner, value, value)

    def adapt(self, attempt: Attempt) -> Adapted:
        inner, *extremes = attempt.memory
        adapted = attempt.by(self.controller, memory=inner)
        value = self.function(attempt.args, attempt.y1)
        wider = widened_extremes(adapted.keep, extremes, value)
        return adapted._replace(memory=(adapted.memory, *wider))


def widened_extremes(
    keep: Scalar, extremes: Sequence[PyTree], values: PyTree
) -> tuple[PyTree, PyTree]:
    """Least and largest values, including those at the end of a step if it is kept."""

    def chosen(choose: Callable[[Scalar, Scalar], Scalar], old: PyTree) -> PyTree:
        return jtu.tree_map(lambda a, b: jnp.where(keep, choose(a, b), a), old, values)

    lowest, highest = extremes
    return chosen(jnp.minimum, lowest), chosen(jnp.maximum, highest)


class GivenFirstStep(AbstractWrappedControl):
    """Wraps a controller and supplies the first step's size; the solve's `dt0` is None.

    diffrax checks a given size by a call back to Python, and a program with such a call cannot be
    kept on disk. Here, sizes are checked before a solve begins.

    Attributes:
        size: size of the first step [s], or of all steps if the controller keeps it.
    """

    size: RealScalarLike

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        terms, t0, t1, y0, _, *rest = request
        size = jnp.asarray(self.size, dtype=jnp.result_type(t0))
        return self.controller.init(terms, t0, t1, y0, size, *rest)

    def adapt(self, attempt: Attempt) -> Adapted:
        return attempt.by(self.controller)


def first_step(duration: Numbers, time_unit: RealScalarLike = 1.0) -> Scalar:
    """The first step to try [s] in a solve of at most `duration` [s]."""
    return jnp.minimum(jnp.full_like(duration, _FIRST_STEP) * time_unit, duration)


class StepsOfOneSize(NamedTuple):
    """Steps that control no error.

    Attributes:
        size: of the first one [s].
        total: how many there are to the end, into which they divide the duration.
    """

    size: Numbers
    total: Numbers

    @staticmethod
    def of(size: Numbers, duration: Numbers) -> "StepsOfOneSize":
        """Those of about this size [s], as diffrax has them."""
        total = by_numpy(
            lambda np, size, end: np.ceil(end / np.nextafter(size, np.inf)), size, duration
        )
        return StepsOfOneSize(size, total)


@cached_jit  # many small operations
def just_before_end(duration: Numbers) -> Scalar:
    """The time such that a step that would end at or after it ends at `duration`, as in diffrax.

    Units are counted in the bits of the 64-bit number, which have the numbers' own order: the same
    count of steps to the preceding number would take XLA seconds to compile.
    """
    bits = jax.lax.bitcast_convert_type(duration, jnp.int64)
    below = jnp.where(duration > 0.0, bits - _CLIPPED_ULPS, bits + _CLIPPED_ULPS)
    # Numbers below the least normal one count for none.
    nothing = -np.finfo(np.float64).tiny * (1.0 + (_CLIPPED_ULPS - 1) * np.finfo(np.float64).eps)
    earlier = jax.lax.bitcast_convert_type(below, jnp.float64)
    return jnp.where(duration == 0.0, nothing, earlier)


def clip_step(
    keep: Scalar, t: Scalar, next_t: Scalar, end: Numbers, almost_end: Numbers
) -> tuple[Scalar, Scalar]:
    """The times at which the next step begins and ends, when it comes near `end`."""
    t = jnp.minimum(t, end)
    last = jnp.where(keep, end, t + 0.5 * (end - t))
    return t, jnp.where(next_t > almost_end, last, next_t)
