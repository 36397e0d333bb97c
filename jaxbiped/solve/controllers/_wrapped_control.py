"""Step-size controllers that wrap another one: what all of them have in common, and two plain ones.

diffrax looks for tolerances and norm on the controller it is given, whatever that wraps.
"""

import abc
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, Time, select
from jaxbiped.solve._accuracy import rms_norm

if TYPE_CHECKING:  # which takes the adaptive one's abstract attributes for arguments
    from diffrax import AbstractStepSizeController as _Control
else:
    from diffrax import AbstractAdaptiveStepSizeController as _Control


class StepControl(Protocol):
    """What is asked of a controller of step sizes; see `diffrax.AbstractStepSizeController`."""

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state."""

    def adapt_step_size(self, *step: Any) -> tuple[Any, ...]:
        """Accepts or rejects a step."""


class Adapted(NamedTuple):
    """What a controller makes of an attempt.

    Attributes:
        keep: whether the step is accepted.
        t0, t1: the next one's ends [s].
        jump: whether a jump was passed.
        memory: the controller's state.
        result: diffrax's.
    """

    keep: Scalar
    t0: Scalar
    t1: Scalar
    jump: Scalar
    memory: Any
    result: Any


class Attempt(NamedTuple):
    """An attempted step, as diffrax tells a controller of it.

    Attributes:
        t0, t1: its ends [s].
        y0, y1: states there.
        args: those of the solve: of a walk the scene.
        error: its estimate, shaped as a state.
        order: of the error.
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
        """What a controller makes of it, or of the same with these changes."""
        return Adapted(*controller.adapt_step_size(*self._replace(**changes)))


class AbstractControl(_Control):  # type: ignore[type-arg]
    """What every controller of this project is for diffrax."""

    @abc.abstractmethod
    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""

    @abc.abstractmethod
    def adapt(self, attempt: Attempt) -> Adapted:
        """Accepts or rejects a step."""

    def wrap(self, direction: RealScalarLike) -> Self:
        """As diffrax asks; direction makes no difference, for walks are never solved backwards."""
        return self

    def adapt_step_size(self, *step: Any) -> Adapted:
        return self.adapt(Attempt(*step))


def try_again(attempt: Attempt, adapted: Adapted, again: Scalar, target: Scalar) -> Adapted:
    """The same where a step is not tried `again`.

    Where it is, the next one ends at the `target` at the latest, and the controller knows what it
    did before.
    """
    sooner = jnp.where(adapted.keep, target, jnp.minimum(adapted.t1, target))
    return adapted._replace(
        memory=select(again, attempt.memory, adapted.memory),
        keep=adapted.keep & ~again,
        t0=jnp.where(again, attempt.t0, adapted.t0),
        t1=jnp.where(again, sooner, adapted.t1),
    )


class AbstractWrappedControl(AbstractControl):
    """Leaves every step's size to another controller, and adds something of its own.

    Attributes:
        controller: decides every step's size.
    """

    controller: StepControl

    @property
    def rtol(self) -> RealScalarLike:
        """The wrapped controller's; steps of one size have no tolerances."""
        return getattr(self.controller, "rtol", 0.0)

    @property
    def atol(self) -> RealScalarLike:
        """The same of the absolute one."""
        return getattr(self.controller, "atol", 0.0)

    @property
    def norm(self) -> Callable[[PyTree], RealScalarLike]:
        """Of errors in units of the tolerance."""
        norm: Callable[[PyTree], RealScalarLike] = getattr(self.controller, "norm", rms_norm)
        return norm


class AbstractMemorylessControl(AbstractWrappedControl):
    """Wraps a controller, whose state is all that is carried from step to step."""

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        return self.controller.init(*request)


class Extremes(AbstractWrappedControl):
    """Wraps a controller; keeps the least and largest values at the ends of the accepted steps.

    Exact for every solver, and without room for the steps themselves. The start counts as an end.

    Attributes:
        function: of (args, state).
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
    """Least and largest values with those at the end of a step, where that is kept."""

    def chosen(choose: Callable[[Scalar, Scalar], Scalar], old: PyTree) -> PyTree:
        return jtu.tree_map(lambda a, b: jnp.where(keep, choose(a, b), a), old, values)

    lowest, highest = extremes
    return chosen(jnp.minimum, lowest), chosen(jnp.maximum, highest)


class GivenFirstStep(AbstractWrappedControl):
    """Wraps a controller; brings the first step's size itself, and the solve's `dt0` is None.

    diffrax checks a size that it is given by a call back to Python, and a program with such a call
    cannot be kept on disk. Sizes are checked before a solve begins.

    Attributes:
        size: of the first step, or of all where the controller keeps it [s].
    """

    size: RealScalarLike

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        terms, t0, t1, y0, _, *rest = request
        size = jnp.asarray(self.size, dtype=jnp.result_type(t0))
        return self.controller.init(terms, t0, t1, y0, size, *rest)

    def adapt(self, attempt: Attempt) -> Adapted:
        return attempt.by(self.controller)
