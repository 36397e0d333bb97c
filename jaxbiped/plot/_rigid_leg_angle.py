"""Leg angles of the rigid walker over time."""

import jax
import jax.tree_util as jtu
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._cached_jit import cached_jit
from jaxbiped._checks import check_positive
from jaxbiped._types import Scalar, as_array, as_float
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.plot._leg_angle import draw_leg_angles
from jaxbiped.scene._scene import RigidScene
from jaxbiped.simulate._rigid_walk import rigid_walk

_SAMPLES = 600


def rigid_leg_angles(
    scene: RigidScene, state: RigidState, *, duration: float, ax: Axes | None = None
) -> Figure:
    """Draws both legs' angles from the slope's normal [rad] over time [s].

    Each leg keeps its colour: the names that the footsteps exchange are exchanged back.

    Args:
        scene: the walker.
        state: start of the walk.
        duration: how long to draw [s].
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: a duration not above 0.
    """
    check_positive("duration", duration, "s")
    times = float(duration) * np.linspace(1.0 / _SAMPLES, 1.0, _SAMPLES)
    scene, state = jtu.tree_map(as_float, (scene, state))
    total, one, two = map(np.asarray, _walked(scene, state, as_array(times)))
    odd = total % 2 == 1
    angles = (np.where(odd, two, one), np.where(odd, one, two))
    return draw_leg_angles(times, angles, "Leg angles on rigid feet", ax)


@cached_jit
def _walked(scene: RigidScene, state: RigidState, times: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Of walks for these times [s]: how many feet came down, and the legs' last angles."""
    walks = jax.vmap(lambda t: rigid_walk(scene, state, duration=t))(times)
    assert walks.arrivals is not None
    return walks.arrivals.total, walks.final.theta_1, walks.final.theta_2
