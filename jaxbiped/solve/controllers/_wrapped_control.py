"""Step-size controllers that wrap another one: what all of them have in common.

diffrax looks for tolerances and norm on the controller it is given, whatever that wraps.
"""

import abc
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeAlias

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import RealScalarLike, Scalar, Time
from jaxbiped.solve._accuracy import rms_norm

if TYPE_CHECKING:  # which takes the adaptive one's abstract attributes for arguments
    from diffrax import AbstractStepSizeController as _Control
else:
    from diffrax import AbstractAdaptiveStepSizeController as _Control

AbstractControl = _Control
"""What every controller of this project is for diffrax."""

Adapted: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Any, Any]
"""Whether a step is kept, the next one's ends, whether a jump was passed, the controller's state,
and diffrax's result."""


class StepControl(Protocol):
    """What is asked of a controller of step sizes; see `diffrax.AbstractStepSizeController`."""

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state."""

    def adapt_step_size(self, *step: Any) -> Adapted:
        """Accepts or rejects a step."""


def try_again(
    again: Scalar, target: Scalar, start: Time, adapted: Adapted, before: Any
) -> tuple[Scalar, Scalar, Scalar, Any]:
    """Whether a step is kept, the next one's ends and the controller's state.

    Where it is tried `again`, the next one ends at the `target` at the latest, and the controller
    knows what it did `before`.
    """
    keep, next_t0, next_t1, _, state, _ = adapted
    sooner = jnp.where(keep, target, jnp.minimum(next_t1, target))
    state = jtu.tree_map(lambda a, b: jnp.where(again, a, b), before, state)
    return keep & ~again, jnp.where(again, start, next_t0), jnp.where(again, sooner, next_t1), state


class AbstractWrappedControl(AbstractControl):  # type: ignore[type-arg]
    """Leaves every step's size to another controller, and adds something of its own.

    Attributes:
        controller: decides every step's size.
    """

    controller: eqx.AbstractVar[StepControl]

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

    def wrap(self, direction: RealScalarLike) -> Self:
        """As diffrax asks; direction makes no difference to what is wrapped here."""
        return self

    @abc.abstractmethod
    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""

    @abc.abstractmethod
    def adapt_step_size(self, *step: Any) -> Adapted:
        """Accepts or rejects a step, as diffrax asks."""
