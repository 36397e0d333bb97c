"""Soundness of a periodic orbit: whether what Newton's method came to is a walk at all.

The return map has fixed points that no walk reaches: under the clearance rule a foot may swing
deep underground and be caught there. Stability does not tell them from gaits, so depth does.
"""

import jax.numpy as jnp
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.dynamics._feet import Foot, feet, touches
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.scene._scene import AbstractScene

_SHORTEST = 0.1
"""Duration of a cycle in units of √(l/g), about 2 for a footstep: a foot may also chatter."""
_DEEPEST = 3.0
"""Elastic force of a standing foot, in units of the walker's weight: about 1 where it stands."""


def is_sound(scene: object, state: PyTree, step_length: Scalar, period: Scalar) -> Scalar:
    """Whether an orbit through a state on its section steps downhill and on the ground (boolean).

    Args:
        scene: the walker; what is none has nothing to be held to.
        state: on the section, where a foot stands or comes down.
        step_length: advance along the slope in a cycle [m].
        period: duration of a cycle [s].
    """
    if not isinstance(scene, AbstractScene):
        return jnp.asarray(True)
    pace = jnp.sqrt(scene.walker.l / scene.ground.g)
    forward = (step_length > 0.0) & (period > _SHORTEST * pace)
    if not scene.compliant:
        return forward
    modelled = scene.minimal
    weight = modelled.walker.total_mass * modelled.ground.g

    def deep(foot: Foot) -> Scalar:
        return touches(foot) & (modelled.normal.elastic_force(foot.penetration) > _DEEPEST * weight)

    both = feet(modelled, minimal_state(scene, state))
    return forward & ~deep(both.foot_1) & ~deep(both.foot_2)
