"""Touchdown ahead: a rejected step in which a foot comes down ends just past that the next time.

The corner of the force there rejects steps of any size that go far past it. Size by size this would
cost some ten attempts at every touchdown of the seed's walker.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._feet import feet
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.solve.controllers._wrapped_control import AbstractWrappedControl, Adapted, StepControl

_LESS_PAST = 0.03
"""How far the next attempt goes past a touchdown, as a share of the rejected one's way."""
_LARGEST = 0.95
"""The next attempt, at most, as a share of the rejected one."""


class TouchdownAhead(AbstractWrappedControl):
    """Wraps a controller; what is tried after a rejected step may be longer than that says.

    The solve's `args` must be the scene.

    Attributes:
        controller: decides every step's size.
    """

    controller: StepControl

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""
        return self.controller.init(*request)

    def adapt_step_size(
        self, t0: Time, t1: Time, y0: PyTree, y1_candidate: PyTree, args: PyTree, *rest: Any
    ) -> Adapted:
        """Accepts or rejects a step as the wrapped controller does; the next one's size differs."""
        keep, next_t0, next_t1, *others = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, *rest
        )
        target = jnp.asarray(t0) + _to_touchdown(args, jnp.asarray(t1 - t0), y0)
        target = jax.lax.stop_gradient(jnp.maximum(next_t1, target))
        jump, state, result = others
        return keep, next_t0, jnp.where(keep, next_t1, target), jump, state, result


def _to_touchdown(scene: CompliantScene, span: Scalar, state: PyTree) -> Scalar:
    """Time to just past where the last foot comes down that does in `span` [s]; 0 if none does.

    At the speed that it has: where that falls short, once more the next time.
    """
    found = jnp.zeros_like(span)
    for foot in feet(scene, state):
        if foot.admitted is False:
            continue
        falls = (foot.penetration < 0.0) & (foot.penetration_rate > 0.0)
        if foot.admitted is not None:
            falls = falls & foot.admitted
        time = -foot.penetration / jnp.where(falls, foot.penetration_rate, 1.0)
        past = jnp.minimum(time + _LESS_PAST * (span - time), _LARGEST * span)
        found = jnp.maximum(found, jnp.where(falls & (time < span), past, 0.0))
    return found
