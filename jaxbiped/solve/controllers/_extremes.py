"""Extremes: a step-size controller that keeps those of something watched."""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped.solve._accuracy import rms_norm


class Extremes(diffrax.AbstractAdaptiveStepSizeController):
    """Wraps a controller; keeps the least and largest values at the ends of the accepted steps.

    Exact for every solver, and without room for the steps themselves. The start counts as an end.

    Attributes:
        rtol, atol, norm: the controller's own, where diffrax looks for them.
        controller: decides every step's size.
        function: of (args, state).
    """

    rtol: Any
    atol: Any
    norm: Callable[[PyTree], Any]
    controller: Any
    function: Callable[[PyTree, PyTree], PyTree] = eqx.field(static=True)

    @staticmethod
    def around(controller: Any, function: Callable[[PyTree, PyTree], PyTree]) -> "Extremes":
        """Wraps a controller."""
        return Extremes(
            rtol=getattr(controller, "rtol", 0.0),  # steps of one size have no tolerances
            atol=getattr(controller, "atol", 0.0),
            norm=getattr(controller, "norm", rms_norm),
            controller=controller,
            function=function,
        )

    def wrap(self, direction: Any) -> "Extremes":
        """As diffrax asks; direction makes no difference here."""
        return Extremes.around(self.controller.wrap(direction), self.function)

    def init(
        self, terms: Any, t0: Any, t1: Any, y0: PyTree, dt0: Any, args: Any, *rest: Any
    ) -> Any:
        """The first step's end and the controller's state, as diffrax asks."""
        first, inner = self.controller.init(terms, t0, t1, y0, dt0, args, *rest)
        value = self.function(args, y0)
        return first, (inner, value, value)

    def adapt_step_size(
        self, t0: Any, t1: Any, y0: PyTree, y1_candidate: PyTree, args: Any, *rest: Any
    ) -> Any:
        """Accepts or rejects a step as the wrapped controller does, and looks."""
        *others, (inner, lowest, highest) = rest
        keep, next_t0, next_t1, jump, inner, result = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, *others, inner
        )
        value = self.function(args, y1_candidate)

        def kept(choose: Callable[[Any, Any], Any], old: PyTree) -> PyTree:
            return jtu.tree_map(lambda a, b: jnp.where(keep, choose(a, b), a), old, value)

        state = (inner, kept(jnp.minimum, lowest), kept(jnp.maximum, highest))
        return keep, next_t0, next_t1, jump, state, result
