"""Phase portraits: a leg of a walk (paper, figure 5), and the periodic orbit of a gait."""

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._types import Numbers
from jaxbiped.gait._gait import Gait
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.plot import style
from jaxbiped.plot._gait_charts import check_drawable
from jaxbiped.plot._samples import sample
from jaxbiped.plot._symbols import LEG_ANGLE, LEG_RATE
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory

_PLACES = (0.12, 0.37, 0.62, 0.87)
"""Of the arrows, in parts of the curve's length."""


def direction_arrows(ax: Axes, x: npt.ArrayLike, y: npt.ArrayLike, colour: str) -> None:
    """Puts arrow heads along a curve, evenly over its length as it is seen."""
    points = np.stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)], axis=-1)
    spans = np.ptp(points, axis=0)
    if len(points) < 2 or not (spans > 0.0).all():
        return
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*(np.diff(points, axis=0) / spans).T))])
    for place in _PLACES:
        ends = np.array([place - 0.004, place + 0.004]) * along[-1]
        tail, head = (tuple(np.interp(end, along, part) for part in points.T) for end in ends)
        ax.annotate(
            "",
            head,
            tail,
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "linewidth": 0.0,
                "mutation_scale": 15.0,
                "shrinkA": 0.0,
                "shrinkB": 0.0,
            },
        )


_FAINT = 0.35
"""Opacity of the whole walk, behind its last stride."""


def phase_portrait(
    scene: Scene,
    trajectory: Trajectory,
    *,
    ax: Axes | None = None,
    legs: tuple[int, ...] = (1,),
) -> Figure:
    """Draws the rate of a leg [rad/s] over its angle from the slope's normal [rad].

    A leg swings forward along the upper half and carries the walker along the lower one; the
    two near-vertical ends are its heel strike (right) and its lifting (left). Faint, the whole
    walk; strong, its last stride, from the leg's last heel strike but one to the end, where there
    are two. Arrows tell the direction, a dot the start, a cross the end of a walk that ended.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        ax: axes to draw into; a new figure unless given.
        legs: which legs to draw: (1,), (2,) or (1, 2).

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step, or a leg of another number.
    """
    check_scene_of(trajectory, scene)
    if not legs or not set(legs) <= {1, 2}:
        raise ArgumentError(f"legs = {legs!r} is not allowed: it must name legs 1, 2 or both.")
    t, state = sample(trajectory)
    strikes = heel_strikes(scene, trajectory)
    angles, rates = (state.theta_1, state.theta_2), (state.omega_1, state.omega_2)
    ax = style.axes_or_new(ax, 5.8, 5.0)
    for k in sorted({leg - 1 for leg in legs}):
        own = strikes.time_s[strikes.foot == k + 1]
        since = float(own[-2]) if own.size > 1 else 0.0
        _draw_leg(ax, k, t, angles[k], rates[k], since)
    if trajectory.outcome != Ending.WALKING:
        for k in sorted({leg - 1 for leg in legs}):
            ax.plot(angles[k][-1], rates[k][-1], "X", color=style.LEG_COLOURS[k], markersize=9)
        _explain(ax, "X", str(trajectory.outcome))
    _explain(ax, "o", "start")
    style.dress(ax, "Phase portrait", LEG_ANGLE.on_axis(), LEG_RATE.on_axis())
    style.legend_below(ax, columns=2)
    return style.figure_of(ax)


def _draw_leg(ax: Axes, k: int, t: np.ndarray, angle: Numbers, rate: Numbers, since: float) -> None:
    """The whole walk, faint where a last stride is drawn over it."""
    look = style.leg_line(k)
    whole: dict[str, Any] = {"linewidth": 1.3, "label": style.LEG_NAMES[k]}
    last = t >= since
    if since > 0.0:
        whole = {"linewidth": 0.8, "alpha": _FAINT, "label": f"{style.LEG_NAMES[k]}, whole walk"}
    ax.plot(angle, rate, **look, **whole)
    if since > 0.0:
        label = f"last stride of {style.LEG_NAMES[k]}, from {since:.2f} s"
        ax.plot(angle[last], rate[last], linewidth=1.5, label=label, **look)
    direction_arrows(ax, angle[last], rate[last], style.LEG_COLOURS[k])
    ax.plot(angle[0], rate[0], "o", color=style.LEG_COLOURS[k], markersize=5)


def _explain(ax: Axes, marker: str, words: str) -> None:
    """An entry of the legend for a mark that each leg has in its own colour."""
    ax.plot([], [], marker, color="#595959", label=words)


def gait_orbit(gait: Gait, *, ax: Axes | None = None) -> Figure:
    """Draws the rate of both legs [rad/s] over their angles from the slope's normal [rad].

    One cycle: the legs are exchanged at each footstep, so the two curves of an odd number of
    footsteps make one closed curve. The dots are the legs on the section, where the cycle begins.
    Arrows tell the direction.

    Args:
        gait: a gait that was found.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: no gait was found, or this is a batch.
    """
    check_drawable(gait)
    ax = style.axes_or_new(ax, 5.6, 4.4)
    start = gait.measures.state
    begins = ((start.theta_1, start.omega_1), (start.theta_2, start.omega_2))
    for k, (angle, rate) in enumerate(_legs(gait)):
        ax.plot(angle, rate, linewidth=1.1, label=style.LEG_NAMES[k], **style.leg_line(k))
        direction_arrows(ax, angle, rate, style.LEG_COLOURS[k])
        ax.plot(*map(float, begins[k]), "o", color=style.LEG_COLOURS[k], markersize=6)
    style.dress(
        ax,
        "Periodic orbit (dots: on the section)",
        LEG_ANGLE.on_axis(),
        LEG_RATE.on_axis(),
    )
    style.legend_above(ax)
    return style.figure_of(ax)


def _legs(gait: Gait) -> list[tuple[np.ndarray, np.ndarray]]:
    """Angle and rate of either leg over the cycle, each under its own name throughout."""
    times = np.asarray(gait.orbit[0])
    states = gait.orbit[1]
    first = np.stack([np.asarray(states.theta_1), np.asarray(states.omega_1)])
    second = np.stack([np.asarray(states.theta_2), np.asarray(states.omega_2)])
    parts: list[list[np.ndarray]] = [[], []]
    for k, known in enumerate(np.isfinite(times)):
        exchanged = k % 2
        parts[exchanged].append(first[:, k, known])
        parts[1 - exchanged].append(second[:, k, known])
    legs = [np.concatenate(part, axis=1) for part in parts]
    return [(angle, rate) for angle, rate in legs]
