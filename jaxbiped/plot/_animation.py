"""Animation of a walk, in an upright view: gravity down the page and the slope inclined."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from jaxbiped._checks import check_positive
from jaxbiped._files import check_writable_file
from jaxbiped.plot import style
from jaxbiped.plot._samples import AnyScene, DrawnMotion
from jaxbiped.plot._skeleton import Pose, poses, skeleton_of, upright
from jaxbiped.solve._trajectory import Trajectory, check_scene_of

_TICK = 0.1
"""Distance between the marks on the slope [m], by which one sees the camera move."""
_ASPECT = 1.6
"""Width of the picture over its height."""


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
        trajectory: the motion, with every step saved; for a rigid walker, its heel strikes.
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
