"""Samples of a rigid walk within its footsteps, which are walked again tightly."""

from collections.abc import Callable
from typing import cast

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar
from jaxbiped.dynamics._state import RigidState
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._rigid_walk import rigid_walk


def states_after(scene: RigidScene, starts: RigidState, durations: np.ndarray) -> RigidState:
    """States so long after their starts [s], within their footsteps; leaves of shape (n,)."""

    def walked(start: RigidState, duration: Scalar) -> RigidState:
        return rigid_walk(scene, start, duration=cast("float", duration), accuracy="tight").final

    each: Callable[[RigidState, Scalar], RigidState] = jax.vmap(walked)
    return each(starts, jnp.asarray(durations))
