"""Leg angles over time (paper, figure 6)."""

import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped.plot._samples import sample
from jaxbiped.plot._symbols import LEG_ANGLE, TIME
from jaxbiped.plot.style import (
    LEG_COLOURS,
    LEG_NAMES,
    LEG_STYLES,
    axes_or_new,
    dress,
    figure_of,
    legend_above,
)
from jaxbiped.scene._scene import Scene
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
        ax.plot(
            t,
            angle,
            color=LEG_COLOURS[k],
            linestyle=LEG_STYLES[k],
            linewidth=1.3,
            label=LEG_NAMES[k],
        )
    ax.margins(x=0.01)
    dress(ax, title, TIME.on_axis(), LEG_ANGLE.on_axis())
    legend_above(ax)
    return figure_of(ax)
