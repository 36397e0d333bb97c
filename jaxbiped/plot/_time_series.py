"""Time series: leg angles (paper, figure 6) and penetration of the feet (figure 7)."""

import jax
import jax.tree_util as jtu
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import check_positive
from jaxbiped._types import Scalar, as_array, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._contact_forces import contacts
from jaxbiped.dynamics._state import RigidState
from jaxbiped.measure._samples import evaluate_along
from jaxbiped.plot._samples import sample
from jaxbiped.plot._symbols import LEG_ANGLE, PENETRATION, TIME
from jaxbiped.plot.style import LEG_NAMES, axes_or_new, dress, figure_of, leg_line, legend_above
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.simulate._simulate import rigid_walk
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


def leg_angles(scene: Scene, trajectory: Trajectory, *, ax: Axes | None = None) -> Figure:
    """Draws both legs' angles from the slope's normal [rad] over time [s].

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step.
    """
    check_scene_of(trajectory, scene)
    t, state = sample(trajectory)
    return draw_leg_angles(t, (state.theta_1, state.theta_2), "Leg angles", ax)


def draw_leg_angles(
    t: npt.ArrayLike, angles: tuple[npt.ArrayLike, npt.ArrayLike], title: str, ax: Axes | None
) -> Figure:
    """Draws the angles of leg 1 and leg 2 [rad] at times [s]."""
    ax = axes_or_new(ax, 7.2, 3.4)
    for k, angle in enumerate(angles):
        ax.plot(t, angle, linewidth=1.3, label=LEG_NAMES[k], **leg_line(k))
    ax.margins(x=0.01)
    dress(ax, title, TIME.on_axis(), LEG_ANGLE.on_axis())
    legend_above(ax)
    return figure_of(ax)


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
    total, one, two = map(np.asarray, _walk_ends(scene, state, as_array(times)))
    odd = total % 2 == 1
    angles = (np.where(odd, two, one), np.where(odd, one, two))
    return draw_leg_angles(times, angles, "Leg angles on rigid feet", ax)


@cached_jit
def _walk_ends(
    scene: RigidScene, state: RigidState, times: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Of walks for these times [s]: how many feet came down, and the legs' last angles."""
    walks = jax.vmap(lambda t: rigid_walk(scene, state, duration=t))(times)
    assert walks.arrivals is not None
    return walks.arrivals.total, walks.final.theta_1, walks.final.theta_2


def penetrations(scene: Scene, trajectory: Trajectory, *, ax: Axes | None = None) -> Figure:
    """Draws how deep each foot that touches is in the ground [mm] over time [s].

    A swing foot that the clearance rule lets pass under the surface does not touch: its line is
    interrupted.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step.
    """
    check_scene_of(trajectory, scene)
    samples = sample(trajectory)
    found = evaluate_along(scene, samples.state, contacts)
    ax = axes_or_new(ax, 7.2, 3.4)
    deepest = 0.0
    for k, (foot, touching) in enumerate(zip(found.feet, found.touching, strict=True)):
        depth = _depth_mm(np.asarray(foot.penetration), touching)
        ax.plot(samples.t, depth, linewidth=1.3, label=LEG_NAMES[k], **leg_line(k))
        deepest = max(deepest, float(np.nanmax(depth, initial=0.0)))
    ax.margins(x=0.01)
    ax.set_ylim(0.0, 1.1 * max(deepest, 1e-3))
    dress(ax, "Penetration of the feet", TIME.on_axis(), PENETRATION.on_axis("mm"))
    legend_above(ax)
    return figure_of(ax)


def _depth_mm(penetration: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """Penetration where the foot touches, zero at the samples just outside, nothing elsewhere."""
    beside = np.zeros_like(touching)
    beside[1:] |= touching[:-1]
    beside[:-1] |= touching[1:]
    at_surface = beside & ~touching & (penetration <= 0.0)
    return np.where(touching | at_surface, np.maximum(penetration, 0.0) * 1e3, np.nan)
