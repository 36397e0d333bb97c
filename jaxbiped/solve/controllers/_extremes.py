"""Extremes: a step-size controller that keeps those of something watched."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.solve.controllers._wrapped_control import AbstractWrappedControl, Adapted, StepControl


class Extremes(AbstractWrappedControl):
    """Wraps a controller; keeps the least and largest values at the ends of the accepted steps.

    Exact for every solver, and without room for the steps themselves. The start counts as an end.

    Attributes:
        controller: decides every step's size.
        function: of (args, state).
    """

    controller: StepControl
    function: Callable[[PyTree, PyTree], PyTree] = eqx.field(static=True)

    def init(
        self,
        terms: Any,
        t0: Time,
        t1: Time,
        y0: PyTree,
        dt0: Scalar | None,
        args: PyTree,
        *rest: Any,
    ) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""
        first, inner = self.controller.init(terms, t0, t1, y0, dt0, args, *rest)
        value = self.function(args, y0)
        return first, (inner, value, value)

    def adapt_step_size(
        self, t0: Time, t1: Time, y0: PyTree, y1_candidate: PyTree, args: PyTree, *rest: Any
    ) -> Adapted:
        """Accepts or rejects a step as the wrapped controller does, and looks."""
        *others, (inner, lowest, highest) = rest
        keep, next_t0, next_t1, jump, inner, result = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, *others, inner
        )
        value = self.function(args, y1_candidate)

        def kept(choose: Callable[[Scalar, Scalar], Scalar], old: PyTree) -> PyTree:
            return jtu.tree_map(lambda a, b: jnp.where(keep, choose(a, b), a), old, value)

        state = (inner, kept(jnp.minimum, lowest), kept(jnp.maximum, highest))
        return keep, next_t0, next_t1, jump, state, result
