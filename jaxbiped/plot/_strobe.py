"""Stroboscopic picture of a walk (paper, figure 4)."""

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped.plot import style
from jaxbiped.plot._animation import Pose, poses
from jaxbiped.plot._samples import end_time, state_at
from jaxbiped.plot._symbols import HEIGHT, HORIZONTAL
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory

_SHOWN = 1.8
"""How long a motion is shown unless told otherwise [s]."""
_APART = 0.1
"""Time between poses unless their number is told [s]."""
_WIDTH, _LEAST, _MOST = 8.6, 2.8, 6.0
"""Width of a new figure, and between what its height lies [inches]."""
_LABELS = (0.8, 0.9)
"""What labels take of a new figure's width and height [inches]."""
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
    count: int | None = None,
) -> Figure:
    """Draws the walker at equal times, older poses fainter, over the slope as it is inclined.

    The title tells which seconds are shown. Legs are lines from the hip to the centre of the foot,
    feet are circles, the thin grey line is the hip's path. Gravity points down the page.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        ax: axes to draw into; a new figure unless given.
        start, stop: first and last time drawn [s]; the end is 1.8 s, about four footsteps of the
            paper's walk, after the start unless given, and never after the motion's own.
        count: number of poses; unless given, one about every 0.1 s.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step, or does not reach the start.
    """
    check_scene_of(trajectory, scene)
    if count is not None:
        check_positive("count", count)
    last = end_time(trajectory)
    stop = min(start + _SHOWN if stop is None else stop, last)
    if not 0.0 <= start < stop:
        raise ArgumentError(
            f"start = {start:g} is not allowed: it must lie before {stop:g} s, where this ends."
        )
    if count is None:
        count = max(round((stop - start) / _APART), 1) + 1
    times = np.concatenate(
        [np.linspace(start, stop, count), np.linspace(start, stop, _PATH_POINTS)]
    )
    everything = poses(scene, state_at(trajectory, times))
    shown = Pose(everything.hip[:count], (everything.feet[0][:count], everything.feet[1][:count]))

    corners = _corners(scene, everything)
    ax = style.axes_or_new(ax, _WIDTH, _height(corners))
    x, steepness = float(shown.hip[0, 0]), -math.tan(float(scene.ground.slope))
    # A straight line that runs on past both edges, whatever the limits become.
    look: dict[str, Any] = {"color": style.GROUND_COLOUR, "linewidth": 1.4, "zorder": 1}
    ax.axline((x, steepness * x), slope=steepness, **look)
    ax.plot(*everything.hip[count:].T, color="#8C8C8C", linewidth=0.8, zorder=1)
    _draw_legs(ax, scene, shown)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlim(*corners[:, 0])
    ax.set_ylim(*corners[:, 1])
    interval = (stop - start) / max(count - 1, 1)
    style.dress(
        ax,
        f"Gait from {start:.2f} s to {stop:.2f} s, a pose every {interval * 1e3:.3g} ms",
        HORIZONTAL.on_axis(),
        HEIGHT.on_axis(),
    )
    handles = [
        Line2D([], [], linewidth=2.0, label=name, **style.leg_line(k))
        for k, name in enumerate(style.LEG_NAMES)
    ]
    ground = Line2D(
        [], [], color=style.GROUND_COLOUR, label=f"slope {float(scene.ground.slope):.3g} rad"
    )
    style.legend_above(ax, handles=[*handles, ground])
    return style.figure_of(ax)


def _draw_legs(ax: Axes, scene: Scene, shown: Pose) -> None:
    count = len(shown.hip)
    opacity = np.linspace(_FAINTEST, 1.0, count) if count > 1 else np.ones(1)
    diameter = np.full(count, 2.0 * float(scene.walker.r))
    for k, feet in enumerate(shown.feet):
        look: dict[str, Any] = {"linestyles": [style.LEG_STYLES[k]], "alpha": opacity}
        legs = LineCollection(
            list(np.stack([shown.hip, feet], axis=1)),
            colors=style.LEG_COLOURS[k],
            linewidths=1.6,
            zorder=3,
            label=style.LEG_NAMES[k],
            **look,
        )
        circles = EllipseCollection(
            diameter,
            diameter,
            np.zeros(count),
            units="xy",
            offsets=feet,
            transOffset=ax.transData,
            facecolors="none",
            edgecolors=style.LEG_COLOURS[k],
            linewidths=0.8,
            zorder=2,
            **look,
        )
        ax.add_collection(legs, autolim=False)
        ax.add_collection(circles, autolim=False)


def _corners(scene: Scene, shown: Pose) -> np.ndarray:
    """The least and the largest X and Z of all that is drawn, with a margin; shape (2, 2)."""
    radius = float(scene.walker.r)
    points = np.concatenate([shown.hip, *(feet - radius for feet in shown.feet)])
    points = np.concatenate([points, *(feet + radius for feet in shown.feet)])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * float(np.max(high - low))
    return np.stack([low - margin, high + margin])


def _height(corners: np.ndarray) -> float:
    """Of a new figure that the picture, on equal scales, fills [inches]."""
    width, height = corners[1] - corners[0]
    needed = (_WIDTH - _LABELS[0]) * height / width + _LABELS[1]
    return float(np.clip(needed, _LEAST, _MOST))
