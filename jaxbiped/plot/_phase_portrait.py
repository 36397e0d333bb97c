"""Phase portrait of a leg (paper, figure 5)."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError
from jaxbiped._ending import Ending
from jaxbiped._types import Numbers
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.plot._arrows import direction_arrows
from jaxbiped.plot._samples import sample
from jaxbiped.plot._symbols import LEG_ANGLE, LEG_RATE
from jaxbiped.plot.style import (
    LEG_COLOURS,
    LEG_NAMES,
    LEG_STYLES,
    axes_or_new,
    dress,
    figure_of,
    legend_below,
)
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory

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
    ax = axes_or_new(ax, 5.8, 5.0)
    for k in sorted({leg - 1 for leg in legs}):
        own = strikes.time_s[strikes.foot == k + 1]
        since = float(own[-2]) if own.size > 1 else 0.0
        _draw_leg(ax, k, t, angles[k], rates[k], since)
    if trajectory.outcome != Ending.WALKING:
        for k in sorted({leg - 1 for leg in legs}):
            ax.plot(angles[k][-1], rates[k][-1], "X", color=LEG_COLOURS[k], markersize=9)
        _explain(ax, "X", str(trajectory.outcome))
    _explain(ax, "o", "start")
    dress(ax, "Phase portrait", LEG_ANGLE.on_axis(), LEG_RATE.on_axis())
    legend_below(ax, columns=2)
    return figure_of(ax)


def _draw_leg(ax: Axes, k: int, t: np.ndarray, angle: Numbers, rate: Numbers, since: float) -> None:
    """The whole walk, faint where a last stride is drawn over it."""
    look: dict[str, Any] = {"color": LEG_COLOURS[k], "linestyle": LEG_STYLES[k]}
    whole: dict[str, Any] = {"linewidth": 1.3, "label": LEG_NAMES[k]}
    last = t >= since
    if since > 0.0:
        whole = {"linewidth": 0.8, "alpha": _FAINT, "label": f"{LEG_NAMES[k]}, whole walk"}
    ax.plot(angle, rate, **look, **whole)
    if since > 0.0:
        label = f"last stride of {LEG_NAMES[k]}, from {since:.2f} s"
        ax.plot(angle[last], rate[last], linewidth=1.5, label=label, **look)
    direction_arrows(ax, angle[last], rate[last], LEG_COLOURS[k])
    ax.plot(angle[0], rate[0], "o", color=LEG_COLOURS[k], markersize=5)


def _explain(ax: Axes, marker: str, words: str) -> None:
    """An entry of the legend for a mark that each leg has in its own colour."""
    ax.plot([], [], marker, color="#595959", label=words)
