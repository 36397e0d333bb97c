"""Crossed switches: a step within which the contact changes its kind must be the more exact.

The embedded estimate of some methods sees little of a corner of the force that a step crosses.
"""

from typing import Any

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, Time
from jaxbiped.dynamics._contact_forces import foot_force
from jaxbiped.dynamics._feet import Foot, feet
from jaxbiped.scene._scene import CompliantScene
from jaxbiped.scene.laws.friction._coulomb import Frictionless
from jaxbiped.solve.controllers._wrapped_control import AbstractWrappedControl, Adapted, StepControl

_SAME_SLIP = 3.0
"""Factor by which the slip speed may change in a step: a Stribeck curve is bent on that scale."""


class CrossedSwitches(AbstractWrappedControl):
    """Wraps a controller; errors of steps that cross a switch of the contact count `weight` times.

    The solve's `args` must be the scene.

    Attributes:
        controller: decides every step's size.
        weight: of those errors [–].
    """

    controller: StepControl
    weight: float

    def init(self, *request: Any) -> tuple[Scalar, Any]:
        """The first step's end and the controller's state, as diffrax asks."""
        return self.controller.init(*request)

    def adapt_step_size(
        self,
        t0: Time,
        t1: Time,
        y0: PyTree,
        y1_candidate: PyTree,
        args: PyTree,
        y_error: PyTree,
        *rest: Any,
    ) -> Adapted:
        """Accepts or rejects a step, as diffrax asks."""
        error = weigh_crossed(args, self.weight, y0, y1_candidate, y_error)
        return self.controller.adapt_step_size(t0, t1, y0, y1_candidate, args, error, *rest)


def weigh_crossed(
    scene: CompliantScene, weight: float, y0: PyTree, y1: PyTree, error: PyTree
) -> PyTree:
    """A step's error, `weight` times where it crosses a switch of the contact.

    Args:
        scene: what is simulated.
        weight: of the error of such a step [–].
        y0, y1: states at the step's start, and at its end or as near to it as its error.
        error: of the step, shaped as the states.
    """
    factor = jnp.where(crosses(scene, y0, y1), weight, 1.0)
    return jtu.tree_map(lambda leaf: leaf * factor.astype(leaf.dtype), error)


def crosses(scene: CompliantScene, y0: PyTree, y1: PyTree) -> Scalar:
    """Whether a foot's contact is of another kind at a step's end than at its start (boolean).

    A foot carries or does not, it slips this way or that, on this side of friction's peak or the
    other, or much faster.
    """
    found = jnp.zeros(jnp.shape(y0[0]), dtype=bool)
    for before, after in zip(feet(scene, y0), feet(scene, y1), strict=True):
        if before.admitted is not False:
            found = found | _changes(scene, before, after)
    return found


def _changes(scene: CompliantScene, before: Foot, after: Foot) -> Scalar:
    carried, carries = (foot_force(scene, foot).normal > 0.0 for foot in (before, after))
    if isinstance(scene.friction, Frictionless):
        return carried != carries
    old, new = before.slip_speed, after.slip_speed
    slow, fast = jnp.abs(old), jnp.abs(new)
    changes = (fast > _SAME_SLIP * slow) | (slow > _SAME_SLIP * fast) | ((old > 0.0) != (new > 0.0))
    friction = scene.friction.switches
    for one, other in zip(friction(old), friction(new), strict=True):
        changes = changes | ((one > 0.0) != (other > 0.0))
    return (carried != carries) | (carries & changes)
