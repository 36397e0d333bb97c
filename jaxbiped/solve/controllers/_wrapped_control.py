"""Step-size controllers that wrap another one: what all of them have in common.

diffrax looks for tolerances and norm on the controller it is given, whatever that wraps.
"""

import abc
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import equinox as eqx
from jaxtyping import PyTree

from jaxbiped.solve._accuracy import rms_norm

if TYPE_CHECKING:  # which takes the adaptive one's abstract attributes for arguments
    from diffrax import AbstractStepSizeController as AbstractControl
else:
    from diffrax import AbstractAdaptiveStepSizeController as AbstractControl


class AbstractWrappedControl(AbstractControl):
    """Leaves every step's size to another controller, and adds something of its own.

    Attributes:
        controller: decides every step's size.
    """

    controller: eqx.AbstractVar[Any]

    @property
    def rtol(self) -> Any:
        """The wrapped controller's; steps of one size have no tolerances."""
        return getattr(self.controller, "rtol", 0.0)

    @property
    def atol(self) -> Any:
        """The same of the absolute one."""
        return getattr(self.controller, "atol", 0.0)

    @property
    def norm(self) -> Callable[[PyTree], Any]:
        """Of errors in units of the tolerance."""
        norm: Callable[[PyTree], Any] = getattr(self.controller, "norm", rms_norm)
        return norm

    def wrap(self, direction: Any) -> "AbstractWrappedControl":
        """As diffrax asks; direction makes no difference to what is wrapped here."""
        return self

    @abc.abstractmethod
    def init(self, *request: Any) -> tuple[Any, Any]:
        """The first step's end and the controller's state, as diffrax asks."""

    @abc.abstractmethod
    def adapt_step_size(self, *step: Any) -> Any:
        """Accepts or rejects a step, as diffrax asks."""
