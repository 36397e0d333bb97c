"""The walk as a stroboscope shows it (paper, figure 4)."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped.plot._samples import end_time, state_at
from jaxbiped.plot._style import (
    GROUND_COLOUR,
    LEG_COLOURS,
    LEG_NAMES,
    axes_or_new,
    dress,
    figure_of,
    legend_above,
)
from jaxbiped.plot._upright import Pose, poses
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._trajectory import Trajectory

_PATH_POINTS = 400
_FAINTEST = 0.3
"""Opacity of the first pose; the last is opaque."""


def gait_strobe(
    scene: Scene,
    trajectory: Trajectory,
    *,
    ax: Axes | None = None,
    start: float = 0.0,
    stop: float | None = None,
    count: int = 10,
) -> Figure:
    """Draws the walker at equal times, older poses fainter, over the slope as it is inclined.

    Legs are lines from the hip to the centre of the foot, feet are circles, the thin grey line is
    the hip's path. Gravity points down the page.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        ax: axes to draw into; a new figure unless given.
        start, stop: first and last time drawn [s]; the end is 0.9 s, about two footsteps of the
            paper's walk, after the start unless given, and never after the motion's own.
        count: number of poses.

    Raises:
        ValueError: the trajectory was not saved step by step, or does not reach the start.
    """
    check_positive("count", count)
    last = end_time(trajectory)
    stop = min(start + 0.9 if stop is None else stop, last)
    if not 0.0 <= start < stop:
        raise ArgumentError(
            f"start = {start:g} is not allowed: it must lie before {stop:g} s, where this ends."
        )
    times = np.concatenate(
        [np.linspace(start, stop, count), np.linspace(start, stop, _PATH_POINTS)]
    )
    everything = poses(scene, state_at(trajectory, times))
    shown = Pose(everything.hip[:count], (everything.feet[0][:count], everything.feet[1][:count]))

    ax = axes_or_new(ax, 7.2, 3.9)
    _draw_slope(ax, scene, shown)
    ax.plot(*everything.hip[count:].T, color="#8C8C8C", linewidth=0.8, zorder=1)
    _draw_legs(ax, scene, shown)
    ax.set_aspect("equal", adjustable="datalim")
    interval = (stop - start) / max(count - 1, 1)
    dress(
        ax,
        f"Gait, a pose every {interval * 1e3:.3g} ms",
        "horizontal position, $X$ (m)",
        "height, $Z$ (m)",
    )
    handles = [
        Line2D([], [], color=colour, linewidth=2.0, label=name)
        for colour, name in zip(LEG_COLOURS, LEG_NAMES, strict=True)
    ]
    ground = Line2D([], [], color=GROUND_COLOUR, label=f"slope {float(scene.ground.slope):.3g} rad")
    legend_above(ax, handles=[*handles, ground])
    return figure_of(ax)


def _draw_legs(ax: Axes, scene: Scene, shown: Pose) -> None:
    count = len(shown.hip)
    opacity = np.linspace(_FAINTEST, 1.0, count) if count > 1 else np.ones(1)
    diameter = np.full(count, 2.0 * float(scene.walker.r))
    for feet, colour, name in zip(shown.feet, LEG_COLOURS, LEG_NAMES, strict=True):
        legs = LineCollection(
            list(np.stack([shown.hip, feet], axis=1)),
            colors=colour,
            linewidths=1.6,
            alpha=opacity,
            zorder=3,
            label=name,
        )
        circles = EllipseCollection(
            diameter,
            diameter,
            np.zeros(count),
            units="xy",
            offsets=feet,
            transOffset=ax.transData,
            facecolors="none",
            edgecolors=colour,
            linewidths=0.8,
            alpha=opacity,
            zorder=2,
        )
        ax.add_collection(legs)
        ax.add_collection(circles, autolim=False)
        ax.update_datalim(feet - 1.1 * diameter[:1])
        ax.update_datalim(feet + 1.1 * diameter[:1])
    ax.autoscale_view()


def _draw_slope(ax: Axes, scene: Scene, shown: Pose) -> None:
    """A straight line that runs on past both edges, whatever the limits become."""
    steepness = -math.tan(float(scene.ground.slope))
    x = float(shown.hip[0, 0])
    ax.axline((x, steepness * x), slope=steepness, color=GROUND_COLOUR, linewidth=1.4, zorder=1)
