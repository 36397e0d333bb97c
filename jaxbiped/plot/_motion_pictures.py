"""Pictures of a motion, gravity down the page: stroboscopic (paper, figure 4) and animated."""

import math
from pathlib import Path
from typing import Any

import jax.tree_util as jtu
import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped._files import check_writable_file
from jaxbiped.plot import style
from jaxbiped.plot._samples import AnyScene, DrawnMotion
from jaxbiped.plot._skeleton import Pose, Skeleton, poses, skeleton_of, upright
from jaxbiped.plot._symbols import HEIGHT, HORIZONTAL
from jaxbiped.simulate._trajectory import Trajectory, check_scene_of

_SHOWN = 1.8
"""Default duration of the motion that is shown [s]."""
_APART = 0.1
"""Default time between poses [s]."""
_WIDTH, _LEAST, _MOST = 8.6, 2.8, 6.0
"""Width of a new figure, and between what its height lies [inches]."""
_LABELS = (0.8, 0.9)
"""What labels take of a new figure's width and height [inches]."""
_PATH_POINTS = 256
"""Of the root point's path, in a second: it turns sharply at a heel strike."""
_FAINTEST = 0.3
"""Opacity of the first pose; the last is opaque."""
_TICK = 0.1
"""Distance between the marks on the slope [m], by which one sees the camera move."""
_ASPECT = 1.6
"""Width of the picture over its height."""


def gait_strobe(
    scene: AnyScene,
    trajectory: Trajectory[Any],
    *,
    ax: Axes | None = None,
    start: float = 0.0,
    stop: float | None = None,
    count: int | None = None,
) -> Figure:
    """Draws the walker at equal times, older poses fainter, over the slope as it is inclined.

    The title states the time interval. Bodies are lines between their hinges and feet, or to their
    mass centres if they have neither. Feet are circles, and the thin grey line is the path of the
    root point. Gravity points down the page.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved; of a rigid walk, the steps or heel strikes.
        ax: axes to draw into. Default: a new figure.
        start, stop: first and last time drawn [s]. Default of `stop`: 1.8 s after the start, about
            four footsteps of the paper's walk, but at most the end of the motion.
        count: number of poses. Default: about one every 0.1 s.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step, or does not reach the start.
    """
    check_scene_of(trajectory, scene)
    if count is not None:
        check_positive("count", count)
    motion = DrawnMotion(scene, trajectory)
    start, last = max(start, motion.first) if start >= 0.0 else start, motion.last
    stop = min(start + _SHOWN if stop is None else stop, last)
    if not 0.0 <= start < stop:
        raise ArgumentError(
            f"start = {start:g} is not allowed: it must lie before {stop:g} s, where this ends."
        )
    if count is None:
        count = max(round((stop - start) / _APART), 1) + 1
    path = np.linspace(start, stop, max(400, int(_PATH_POINTS * (stop - start))))
    times = np.concatenate([np.linspace(start, stop, count), path])
    skeleton, everything = skeleton_of(scene.mechanism), poses(scene, motion.at(times))
    shown = jtu.tree_map(lambda points: points[:count], everything)
    corners = corners_of(skeleton, everything)
    across, up = corners[1] - corners[0]
    if ax is None:
        # On equal scales the picture fills a new figure.
        height = (_WIDTH - _LABELS[0]) * up / across + _LABELS[1]
        ax = style.new_figure(_WIDTH, float(np.clip(height, _LEAST, _MOST))).add_subplot()
    slope = float(scene.ground.slope)
    x, steepness = float(shown.root[0, 0]), -math.tan(slope)
    # A straight line that runs on past both edges, whatever the limits become.
    look: dict[str, Any] = {"color": style.GROUND_COLOUR, "linewidth": 1.4, "zorder": 1}
    ax.axline((x, steepness * x), slope=steepness, **look)
    ax.plot(*everything.root[count:].T, color="#8C8C8C", linewidth=0.8, zorder=1)
    draw_bodies(ax, skeleton, shown)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlim(*corners[:, 0])
    ax.set_ylim(*corners[:, 1])
    interval = 1e3 * (stop - start) / max(count - 1, 1)
    title = f"Gait from {start:.2f} s to {stop:.2f} s, a pose every {interval:.3g} ms"
    style.dress(ax, title, HORIZONTAL.on_axis(), HEIGHT.on_axis())
    handles = [
        Line2D([], [], linewidth=1.6, label=part.label, **part.look.line) for part in skeleton.parts
    ]
    handles.append(Line2D([], [], color=style.GROUND_COLOUR, label=f"slope {slope:.3g} rad"))
    extent, figure = ax.get_window_extent(), style.figure_of(ax)
    width = min(1.1 * extent.width, extent.height * across / up) / figure.dpi
    style.legend_above(ax, width=width, handles=handles)
    return figure


def draw_bodies(ax: Axes, skeleton: Skeleton, shown: Pose) -> None:
    """Draws poses, the first ones fainter."""
    count = len(shown.root)
    opacity = np.linspace(_FAINTEST, 1.0, count) if count > 1 else np.ones(1)
    for part, lines in zip(skeleton.parts, shown.lines, strict=True):
        dashes = [part.look.line["linestyle"]]
        look: dict[str, Any] = {"colors": part.look.colour, "linestyles": dashes, "alpha": opacity}
        drawn = LineCollection(list(lines), linewidths=1.6, zorder=3, label=part.label, **look)
        ax.add_collection(drawn, autolim=False)
    for sole, feet in zip(skeleton.feet, shown.feet, strict=True):
        diameter, dashes = np.full(count, 2.0 * sole.radius), [sole.look.line["linestyle"]]
        look = {"edgecolors": sole.look.colour, "linestyles": dashes, "alpha": opacity}
        look |= {"facecolors": "none", "linewidths": 0.8, "zorder": 2}
        place: dict[str, Any] = {"units": "xy", "offsets": feet, "transOffset": ax.transData}
        circles = EllipseCollection(diameter, diameter, np.zeros(count), **place, **look)
        ax.add_collection(circles, autolim=False)


def corners_of(skeleton: Skeleton, shown: Pose) -> np.ndarray:
    """The least and the largest X and Z of all that is drawn, with a margin; shape (2, 2)."""
    soles = zip(skeleton.feet, shown.feet, strict=True)
    reach = [feet + sign * sole.radius for sole, feet in soles for sign in (-1.0, 1.0)]
    lines = [line.reshape(-1, 2) for line in shown.lines]
    points = np.concatenate([shown.root, *lines, *reach])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * float(np.max(high - low))
    return np.stack([low - margin, high + margin])


def animate(
    scene: AnyScene,
    trajectory: Trajectory[Any],
    *,
    frames_per_second: float = 25.0,
    slow_down: float = 1.0,
) -> FuncAnimation:
    """An animation of the walk, with gravity down the page and a camera that moves with the hip.

    Bodies are lines between their hinges and feet, or to their mass centres if they have neither.
    Dots mark mass centres; feet are circles.

    The slope carries a mark every 0.1 m. A motion of T seconds has
    floor(T × slow_down × frames_per_second) + 1 frames. Keep the result until it is saved.

    Args:
        scene: the scene that was simulated.
        trajectory: the motion, with every step saved; of a rigid walk, the steps or heel strikes.
        frames_per_second: frames per second of the picture; a GIF rounds the time of a frame to 10
            ms.
        slow_down: seconds of the animation per second of the motion.

    Returns:
        The animation, a matplotlib object.

    Raises:
        ValueError: the trajectory was not saved step by step, or a number is not above 0.
    """
    check_scene_of(trajectory, scene)
    check_positive("frames_per_second", frames_per_second)
    check_positive("slow_down", slow_down)
    interval = 1.0 / (frames_per_second * slow_down)
    motion = DrawnMotion(scene, trajectory)
    count = int((motion.last - motion.first) / interval + 1e-9) + 1
    times = np.minimum(motion.first + np.arange(count) * interval, motion.last)
    shown = poses(scene, motion.at(times))
    figure = style.new_figure(3.0 * _ASPECT, 3.0)
    figure.set_dpi(100)
    figure.set_layout_engine("none")
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    picture = _Picture(ax, scene, shown, times)
    return FuncAnimation(
        figure, picture.draw, frames=len(times), interval=1e3 / frames_per_second, blit=False
    )


def save_animation(animation: FuncAnimation, path: str | Path) -> Path:
    """Writes an animation as a GIF that repeats, and returns its path.

    Args:
        animation: from `animate`.
        path: path of the file to write.

    Returns:
        The path.

    Raises:
        ArgumentError: no file can be written at the path.
    """
    where = check_writable_file("path", path)
    animation.save(str(where), writer="pillow")
    return where


def animation_html(animation: FuncAnimation) -> str:
    """An animation as HTML with controls, for `IPython.display.HTML`.

    Args:
        animation: from `animate`.

    Returns:
        HTML that contains the frames.
    """
    return animation.to_jshtml()


class _Picture:
    """The artists of one frame and how they move."""

    def __init__(self, ax: Axes, scene: AnyScene, shown: Pose, times: np.ndarray) -> None:
        self._ax, self._shown, self._times = ax, shown, times
        skeleton = skeleton_of(scene.mechanism)
        rises = [np.max(line[..., 1] - shown.root[:, None, 1]) for line in shown.lines]
        self._above = max(0.3 * skeleton.height, 1.15 * float(np.max(rises)))
        self._below = 1.2 * skeleton.height
        self._half_width = 0.5 * _ASPECT * (self._above + self._below)
        self._draw_ground(float(scene.ground.slope), 2.5 * self._half_width)
        self._bodies: list[Line2D] = []
        for part in skeleton.parts:
            (line,) = ax.plot([], [], linewidth=4.0, label=part.label, **part.look.line)
            self._bodies.append(line)
        self._feet: list[Circle] = []
        for sole in skeleton.feet:
            look = sole.look.line
            look["edgecolor"] = look.pop("color")
            circle = Circle((0.0, 0.0), sole.radius, facecolor="none", linewidth=2.0, **look)
            ax.add_patch(circle)
            self._feet.append(circle)
        dots: dict[str, Any] = {"linestyle": "none", "color": "black", "zorder": 3}
        (self._centres,) = ax.plot([], [], marker=".", label="mass centre", **dots)
        (self._hinges,) = ax.plot([], [], marker="o", markerfacecolor="white", **dots)
        (self._root,) = ax.plot([], [], marker="o", markersize=7, label=skeleton.root, **dots)
        self._clock = ax.text(0.02, 0.95, "", transform=ax.transAxes, va="top")
        ax.set_aspect("equal", adjustable="datalim")
        style.legend(ax, loc="upper right", handlelength=3.5)
        samples: Any = ax.get_legend()
        for line in samples.get_lines()[: len(self._bodies)]:
            line.set_linewidth(2.0)  # thinner than in the picture, to show all dashes
        ax.set_axis_off()
        self.draw(0)

    def _draw_ground(self, slope: float, reach: float) -> None:
        places = self._shown.root[:, 0]
        first = np.floor((places.min() - reach) / _TICK)
        last = np.ceil((places.max() + reach) / _TICK)
        along = np.arange(first, last + 1.0) * _TICK
        surface = upright(slope, along, np.zeros_like(along))
        below = upright(slope, along - 0.02, np.full_like(along, -0.02))
        self._ax.plot(*surface.T, color=style.GROUND_COLOUR, linewidth=1.5)
        gap = np.full_like(surface, np.nan)
        marks = np.stack([surface, below, gap], axis=1).reshape(-1, 2)
        self._ax.plot(*marks.T, color=style.GROUND_COLOUR, linewidth=1.0)

    def draw(self, frame: int) -> list[Artist]:
        """Moves everything to a frame, and the camera with it."""
        shown, (x, z) = self._shown, self._shown.root[frame]
        for body, line in zip(self._bodies, shown.lines, strict=True):
            body.set_data(*line[frame].T)
        for circle, centre in zip(self._feet, shown.feet, strict=True):
            circle.set_center(tuple(centre[frame]))
        self._centres.set_data(*np.array([each[frame] for each in shown.centres]).T)
        self._hinges.set_data(*np.array([each[frame] for each in shown.hinges]).T)
        self._root.set_data([x], [z])
        self._clock.set_text(f"$t$ = {self._times[frame]:.2f} s")
        self._ax.set_xlim(x - self._half_width, x + self._half_width)
        self._ax.set_ylim(z - self._below, z + self._above)
        marks = [self._centres, self._hinges, self._root, self._clock]
        return [*self._bodies, *self._feet, *marks]
