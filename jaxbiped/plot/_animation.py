"""Animation of a walk, in an upright view: gravity down the page and the slope inclined."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from jaxbiped._checks import check_positive
from jaxbiped._files import check_writable_file
from jaxbiped.dynamics._contacts import feet
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._state import State
from jaxbiped.plot import style
from jaxbiped.plot._samples import end_time, state_at
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory


class Pose(NamedTuple):
    """Points of the walker, arrays of shape (n, 2): horizontal and vertical position [m].

    Attributes:
        hip: the hip.
        feet: centres of foot 1 and foot 2.
    """

    hip: np.ndarray
    feet: tuple[np.ndarray, np.ndarray]


def upright(scene: Scene, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Points of the slope's frame [m] with gravity pointing down the page, shape (..., 2)."""
    slope = float(scene.ground.slope)
    horizontal = np.cos(slope) * x + np.sin(slope) * z
    vertical = np.cos(slope) * z - np.sin(slope) * x
    return np.stack([horizontal, vertical], axis=-1)


def poses(scene: Scene, state: State) -> Pose:
    """The walker at states with leaves of shape (n,)."""
    hip = minimal_state(scene, state)
    first, second = (
        upright(scene, np.asarray(foot.x), np.asarray(foot.z)) for foot in feet(scene, state)
    )
    return Pose(upright(scene, np.asarray(hip.hip_x), np.asarray(hip.hip_z)), (first, second))


_TICK = 0.1
"""Distance between the marks on the slope [m], by which one sees the camera move."""


def animate(
    scene: Scene,
    trajectory: Trajectory,
    *,
    frames_per_second: float = 25.0,
    slow_down: float = 1.0,
) -> FuncAnimation:
    """An animation of the walk, gravity down the page, the camera moving along with the hip.

    The slope carries a mark every 0.1 m. A motion of T seconds has
    floor(T × slow_down × frames_per_second) + 1 frames. Keep the result until it is saved.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        frames_per_second: of the picture [1/s]; a GIF rounds the time of a frame to 10 ms.
        slow_down: seconds of the picture for a second of the motion.

    Returns:
        The animation, of matplotlib.

    Raises:
        ValueError: the trajectory was not saved step by step, or a number not above 0.
    """
    check_scene_of(trajectory, scene)
    check_positive("frames_per_second", frames_per_second)
    check_positive("slow_down", slow_down)
    interval = 1.0 / (frames_per_second * slow_down)
    last = end_time(trajectory)
    times = np.minimum(np.arange(int(last / interval + 1e-9) + 1) * interval, last)
    shown = poses(scene, state_at(trajectory, times))
    figure = style.new_figure(4.8, 3.0)
    figure.set_dpi(100)
    figure.set_layout_engine("none")
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    picture = _Picture(ax, scene, shown, times)
    return FuncAnimation(
        figure, picture.draw, frames=len(times), interval=1e3 / frames_per_second, blit=False
    )


def save_animation(animation: FuncAnimation, path: str | Path) -> Path:
    """Writes what `animate` returned as a GIF that repeats, and returns its path.

    Args:
        animation: from `animate`.
        path: of the file to write.

    Returns:
        The path.

    Raises:
        ArgumentError: a path where no file can be written.
    """
    where = check_writable_file("path", path)
    animation.save(str(where), writer="pillow")
    return where


def animation_html(animation: FuncAnimation) -> str:
    """What `animate` returned as HTML with controls, for `IPython.display.HTML`.

    Args:
        animation: from `animate`.

    Returns:
        HTML, the frames within it.
    """
    return animation.to_jshtml()


class _Picture:
    """The artists of one frame and how they move."""

    def __init__(self, ax: Axes, scene: Scene, shown: Pose, times: np.ndarray) -> None:
        self._ax, self._shown, self._times = ax, shown, times
        length = float(scene.walker.l)
        radius = float(scene.walker.r)
        self._half_width = 1.2 * length
        self._draw_ground(scene, length)
        self._legs: list[Line2D] = []
        self._feet: list[Circle] = []
        for k, name in enumerate(style.LEG_NAMES):
            look = style.leg_line(k)
            (line,) = ax.plot([], [], linewidth=4.0, label=name, **look)
            look["edgecolor"] = look.pop("color")
            circle = Circle((0.0, 0.0), radius, facecolor="none", linewidth=2.0, **look)
            ax.add_patch(circle)
            self._legs.append(line)
            self._feet.append(circle)
        (self._hip,) = ax.plot([], [], "o", color="black", markersize=7)
        self._clock = ax.text(0.02, 0.95, "", transform=ax.transAxes, va="top")
        ax.set_aspect("equal", adjustable="datalim")
        style.legend(ax, loc="upper right", handlelength=3.5)
        ax.set_axis_off()
        self.draw(0)

    def _draw_ground(self, scene: Scene, length: float) -> None:
        hips = self._shown.hip[:, 0]
        first = np.floor((hips.min() - 3.0 * length) / _TICK)
        last = np.ceil((hips.max() + 3.0 * length) / _TICK)
        along = np.arange(first, last + 1.0) * _TICK
        surface = upright(scene, along, np.zeros_like(along))
        below = upright(scene, along - 0.02, np.full_like(along, -0.02))
        self._ax.plot(*surface.T, color=style.GROUND_COLOUR, linewidth=1.5)
        gap = np.full_like(surface, np.nan)
        marks = np.stack([surface, below, gap], axis=1).reshape(-1, 2)
        self._ax.plot(*marks.T, color=style.GROUND_COLOUR, linewidth=1.0)

    def draw(self, frame: int) -> list[Artist]:
        """Moves everything to a frame, and the camera with it."""
        hip_x, hip_z = self._shown.hip[frame]
        for line, circle, centres in zip(self._legs, self._feet, self._shown.feet, strict=True):
            x, z = centres[frame]
            line.set_data([hip_x, x], [hip_z, z])
            circle.set_center((x, z))
        self._hip.set_data([hip_x], [hip_z])
        self._clock.set_text(f"$t$ = {self._times[frame]:.2f} s")
        self._ax.set_xlim(hip_x - self._half_width, hip_x + self._half_width)
        self._ax.set_ylim(hip_z - self._half_width, hip_z + 0.25 * self._half_width)
        return [*self._legs, *self._feet, self._hip, self._clock]
