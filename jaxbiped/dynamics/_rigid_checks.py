"""Checks of the rigid limit: whether real feet could do what it assumes."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import check_not_negative, check_type
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._impact import impact
from jaxbiped.dynamics._rolling import rolling
from jaxbiped.dynamics._state import state_type
from jaxbiped.dynamics._strike_surfaces import clearance
from jaxbiped.scene._scene import RigidScene
from jaxbiped.scene._scene_checks import check_scene


class RigidChecks(NamedTuple):
    """Requirements of a footstep on the ground, at n states in order of time.

    Attributes:
        normal: normal force on the stance foot [N], shape (n,); if it is below zero, the foot
            flies.
        needed_friction: smallest coefficient of friction that prevents slip [–], shape (n,);
            infinite if the foot flies.
        clearance: height of the swing foot above the ground [m], shape (n,); if it is below zero,
            the foot scuffs.
        impact_friction: the same coefficient for the impact that ends the footstep.
        lifting: speed at which the trailing foot leaves the ground after the impact [m/s]; if it is
            below zero, the ground would have held the foot.
    """

    normal: Scalar
    needed_friction: Scalar
    clearance: Scalar
    impact_friction: Scalar
    lifting: Scalar

    @property
    def flies(self) -> Scalar:
        """Whether the stance foot would leave the ground (booleans, shape (n,))."""
        return self.normal <= 0.0

    @property
    def scuffs(self) -> Scalar:
        """Whether the swing foot is below the ground (booleans, shape (n,))."""
        return self.clearance < 0.0

    def slips(self, mu: float) -> Scalar:
        """Whether a foot with this coefficient of friction would slip (booleans, shape (n,)).

        Raises:
            ArgumentError: mu below 0.
        """
        check_not_negative("mu", mu)
        return self.needed_friction > mu


def rigid_checks(scene: RigidScene, states: Any) -> RigidChecks:
    """Checks a footstep from a series of its states, such as `gait.orbit[1]`.

    Args:
        scene: the walker.
        states: n states in order, with leaves of any shape that has n entries; states that are not
            finite are left out. The last one counts as the moment of the impact.

    Returns:
        The requirements of the footstep, with leaves of shape (n,), and those of its impact,
            scalars.

    Raises:
        ArgumentError: an argument has the wrong type.
    """
    scene = check_scene(scene, RigidScene)
    check_type("states", states, state_type(scene))
    states = jtu.tree_map(lambda leaf: np.ravel(np.asarray(leaf)), states)
    known = np.isfinite(states[1])
    last = np.max(np.flatnonzero(known), initial=0)
    # Of all states: one program then serves for any number of those that are known.
    found = _checks(scene, jtu.tree_map(jnp.asarray, states), jnp.asarray(last))

    def of_known(leaf: Scalar) -> Scalar:
        return jnp.asarray(np.asarray(leaf)[known])

    return found._replace(
        normal=of_known(found.normal),
        needed_friction=of_known(found.needed_friction),
        clearance=of_known(found.clearance),
    )


@cached_jit
def _checks(scene: RigidScene, states: Any, last: Scalar) -> RigidChecks:
    """The checks of n states, shape (n,), the impact's at the last of them."""
    force = rolling(scene, states).force
    normal, tangential = force.normal, jnp.abs(jnp.asarray(force.tangential))
    needed = jnp.where(normal > 0.0, tangential / jnp.where(normal > 0.0, normal, 1.0), jnp.inf)
    struck = impact(scene, jtu.tree_map(lambda leaf: leaf[last], states))
    return RigidChecks(
        normal=normal,
        needed_friction=needed,
        clearance=clearance(scene, states),
        impact_friction=jnp.abs(struck.impulse_x) / struck.impulse_z,
        lifting=struck.lifting,
    )
