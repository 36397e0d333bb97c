"""The seed's walker with the names of its angles, lengths, points, frames and forces.

The pose and the slope are exaggerated, and the standing foot sinks far deeper than it does in a
walk. Points come from the package's own kinematics.
"""

from typing import Any

import numpy as np
from _experiment import Options, experiment
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle

import jaxbiped as jb
from jaxbiped.plot import style

SLOPE, ANGLES, DEPTH = 0.22, (-0.62, 0.30), 0.022
"""Slope and angles of legs 1 and 2 [rad], and depth of the standing foot [m]."""
GREY = style.GROUND_COLOUR


@experiment
def main(options: Options):
    scene = jb.seed_scene(slope=SLOPE)
    state = scene.state(theta_1=ANGLES[0], theta_2=ANGLES[1], standing="2")
    state = state._replace(hip_z=state.hip_z - DEPTH)
    feet = [(float(foot.x), float(foot.z)) for foot in jb.dynamics.feet(scene, state)]
    hip = (float(state.hip_x), float(state.hip_z))
    figure = style.new_figure(7.0, 6.0)
    ax = figure.add_subplot()
    draw_ground(ax)
    draw_walker(ax, scene.walker, np.array(hip), np.array(feet))
    ax.set_aspect("equal")
    ax.axis("off")
    picture = options.save(figure, "walker_sketch.png")
    return {"hip_m": hip, "foot_centres_m": feet, "picture": picture}


def seen(point: Any) -> np.ndarray:
    """A point of the slope's frame in the picture: horizontal to the right, height upwards."""
    x, z = np.moveaxis(np.asarray(point, float), -1, 0)
    cosine, sine = np.cos(SLOPE), np.sin(SLOPE)
    return np.stack((x * cosine + z * sine, z * cosine - x * sine), axis=-1)


def line(ax: Axes, first: Any, last: Any, **how: Any) -> None:
    """A line between two points of the slope's frame."""
    ax.plot(*seen([first, last]).T, **{"color": GREY, "linewidth": 1.0} | how)


def arrow(
    ax: Axes, first: Any, last: Any, name: str = "", shift: Any = (0.0, 0.0), **how: Any
) -> None:
    """An arrow between two points of the slope's frame, with a name at its head."""
    look = {"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0} | how
    ax.annotate("", seen(last), seen(first), arrowprops=look)
    write(ax, np.asarray(last) + shift, name, color=look["color"])


def write(ax: Axes, point: Any, words: str, **how: Any) -> None:
    """Words about a point of the slope's frame."""
    ax.text(*seen(point), words, **{"ha": "center", "va": "center", "fontsize": 13} | how)


def draw_ground(ax: Axes) -> None:
    """The slope, its angle, the frame that is fixed to it, and gravity."""
    left, right = (-0.46, 0.0), (0.30, 0.0)
    line(ax, left, right, color=GREY, linewidth=2.0)
    for x in np.arange(-0.45, 0.03, 0.03):
        line(ax, (x, 0.0), (x - 0.012, -0.014))
    start = seen(left)
    ax.plot([start[0], start[0] + 0.2], [start[1]] * 2, color=GREY, linewidth=1.0, linestyle="--")
    opened = np.degrees(SLOPE)
    ax.add_patch(Arc(start, 0.32, 0.32, theta1=-opened, theta2=0.0, color="black"))
    ax.text(start[0] + 0.178, start[1] - 0.02, r"$\alpha$", fontsize=14, ha="center", va="center")
    origin = np.array((-0.46, 0.20))
    arrow(ax, origin, np.add(origin, (0.09, 0.0)), "$x$", (0.018, 0.0))
    arrow(ax, origin, np.add(origin, (0.0, 0.09)), "$z$", (0.0, 0.018))
    down = np.array((np.sin(SLOPE), -np.cos(SLOPE)))
    arrow(ax, (0.24, 0.40), (0.24, 0.40) + 0.09 * down, "$g$", 0.02 * down)


def draw_walker(ax: Axes, walker: Any, hip: np.ndarray, feet: np.ndarray) -> None:
    """Legs, feet, mass centres, and the names of lengths, angles and forces."""
    r, d, l = (float(each) for each in (walker.r, walker.d, walker.l))
    line(ax, hip, hip - (0.0, 0.30), linestyle="--")
    for k, (foot, angle) in enumerate(zip(feet, ANGLES, strict=True)):
        colour, number = style.LEG_COLOURS[k], k + 1
        along = (foot - hip) / np.hypot(*(foot - hip))
        ahead = np.array((-along[1], along[0]))
        out = ahead
        line(ax, hip, foot, color=colour, linewidth=3.0)
        ax.add_patch(Circle(seen(foot), r, fill=False, color=colour, linewidth=1.8))
        ax.plot(*seen(hip + d * along), "o", color=colour, markersize=9)
        write(ax, hip + d * along + 0.028 * out, rf"$C_{number}$", color=colour)
        ax.plot(*seen(foot), "o", color=colour, markersize=5)
        write(
            ax, np.add(foot, (-0.024 if k == 0 else 0.024, 0.012)), rf"$O_{number}$", color=colour
        )
        sweep = np.linspace(0.0, angle, 40)
        reach = 0.23 if k == 0 else 0.27
        bow = hip + reach * np.stack((np.sin(sweep), -np.cos(sweep)), axis=-1)
        ax.plot(*seen(bow).T, color=colour, linewidth=1.2)
        ax.annotate(
            "", seen(bow[-1]), seen(bow[-4]), arrowprops={"arrowstyle": "-|>", "color": colour}
        )
        middle = hip + (reach + 0.022) * np.array((np.sin(angle / 2), -np.cos(angle / 2)))
        write(ax, middle, rf"$\theta_{number}$", color=colour)
    along = (feet[0] - hip) / np.hypot(*(feet[0] - hip))
    side = np.array((along[1], -along[0]))
    for length, away, name in ((d, 0.05, "$d$"), (l, 0.105, "$l$")):
        for point in (hip, hip + length * along):
            line(ax, point + 0.012 * side, point + (away + 0.01) * side, linewidth=0.6)
        ends = hip + away * side, hip + length * along + away * side
        measure(ax, *ends, name, 0.018 * side)
    arrow(ax, feet[0], feet[0] + r * np.array((-0.35, -0.937)), color=style.LEG_COLOURS[0])
    write(ax, np.add(feet[0], (-0.036, -0.046)), "$r$", color=style.LEG_COLOURS[0])
    ax.plot(*seen(hip), "o", color="white", markeredgecolor="black", markersize=9, zorder=5)
    write(ax, np.add(hip, (0.0, 0.026)), "$S$")
    draw_contact(ax, feet[1], r)


def draw_contact(ax: Axes, foot: np.ndarray, r: float) -> None:
    """Penetration of the standing foot, and the forces that act on it."""
    below = np.array((foot[0], foot[1] - r))
    beside = np.array((0.105, 0.0))
    line(ax, below, below + beside + (0.015, 0.0), linewidth=0.8)
    measure(ax, (below[0] + beside[0], below[1]), (below[0] + beside[0], 0.0), "", (0.0, 0.0))
    write(ax, (below[0] + beside[0] + 0.022, below[1] / 2), r"$\delta_2$")
    arrow(ax, below, np.add(below, (0.0, 0.075)), "$F_{N,2}$", (-0.034, -0.012), linewidth=1.6)
    arrow(ax, below, below - (0.085, 0.0), "$F_{T,2}$", (-0.002, -0.022), linewidth=1.6)


def measure(ax: Axes, first: Any, last: Any, name: str, shift: Any) -> None:
    """A length between two points, with a head at both ends."""
    look = {"arrowstyle": "<|-|>", "color": GREY, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.0}
    ax.annotate("", seen(last), seen(first), arrowprops=look)
    write(ax, (np.asarray(first) + last) / 2 + shift, name)


if __name__ == "__main__":
    main()
