"""Contact forces over time, and one heel strike enlarged (paper, figure 8)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jaxbiped._checks import ArgumentError
from jaxbiped.dynamics._contacts import Contacts
from jaxbiped.measure._footsteps import heel_strikes
from jaxbiped.plot._samples import sampled_forces
from jaxbiped.plot._symbols import NORMAL_FORCE, TANGENTIAL_FORCE, TIME
from jaxbiped.plot.style import LEG_NAMES, SHADE_COLOUR, dress, leg_line, legend_above, new_figure
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._scene_key import check_scene_of
from jaxbiped.solve._trajectory import Trajectory

_BEFORE, _AFTER = 0.5e-3, 4.5e-3
"""What is enlarged around a heel strike [s]."""


def contact_forces(
    scene: Scene,
    trajectory: Trajectory,
    *,
    figure: Figure | SubFigure | None = None,
    strike: int = -1,
) -> Figure:
    """Draws the forces of the ground on both feet [N] over time.

    Left, the whole motion; right, one heel strike in milliseconds, with double support shaded.
    Above, the normal force; below, the tangential one, downhill positive, where there is friction.
    Drawn at the solver's own steps and, about every peak, at times far closer together than
    these (see `sampled_forces`), so that peaks do not depend on where steps happen to end.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        figure: empty figure or subfigure to draw into; a new one unless given.
        strike: which heel strike to enlarge, counted from 0, or from the last: -1. A motion
            without a heel strike has no right-hand column.

    Returns:
        The figure given, or the new one.

    Raises:
        ValueError: the trajectory was not saved step by step, or has fewer heel strikes.
    """
    check_scene_of(trajectory, scene)
    t, found = sampled_forces(scene, trajectory)
    times, feet = heel_strikes(scene, trajectory)
    if times.size and not -times.size <= strike < times.size:
        raise ArgumentError(
            f"strike = {strike} is not allowed: this motion has {times.size} heel strikes."
        )
    rows = 1 if found.forces.foot_1.tangential is None else 2
    columns = 2 if times.size else 1
    if figure is None:
        figure = new_figure(4.6 * columns, 1.0 + 2.2 * rows)
    axes = figure.subplots(
        rows, columns, sharex="col", squeeze=False, width_ratios=[1.35, 1.0][:columns]
    )
    _draw_column(axes[:, 0], t, found)
    axes[0, 0].margins(x=0.01)
    dress(axes[0, 0], "Contact forces", "", NORMAL_FORCE.on_axis())
    legend_above(axes[0, 0])
    if rows == 2:
        dress(axes[1, 0], "", "", TANGENTIAL_FORCE.on_axis())
    axes[-1, 0].set_xlabel(TIME.on_axis())
    if times.size:
        _draw_strike(axes[:, 1], scene, trajectory, times[strike], feet[strike] - 1)
    whole = figure.figure
    assert isinstance(whole, Figure)
    return whole


def _draw_column(axes: np.ndarray, t: np.ndarray, found: Contacts) -> None:
    for k, force in enumerate(found.forces):
        look = leg_line(k) | {"linewidth": 1.1, "label": LEG_NAMES[k]}
        axes[0].plot(t, force.normal, **look)
        if force.tangential is not None:
            axes[1].plot(t, force.tangential, **look)


def _draw_strike(
    axes: np.ndarray, scene: Scene, trajectory: Trajectory, time: float, leg: int
) -> None:
    t, found = sampled_forces(scene, trajectory, start=time - _BEFORE, stop=time + _AFTER)
    milliseconds = (t - time) * 1e3
    _draw_column(axes, milliseconds, found)
    normal = [np.asarray(force.normal) for force in found.forces]
    both = milliseconds[found.both_carry]
    for ax in axes:
        if both.size:
            ax.axvspan(both[0], both[-1], color=SHADE_COLOUR, linewidth=0, label="double support")
        ax.margins(x=0.0, y=0.12)
        dress(ax, "", "", "")
    axes[0].set_title(
        f"Heel strike of {LEG_NAMES[leg]} at {time:.3f} s", loc="left", fontsize="medium"
    )
    axes[-1].set_xlabel("time after the foot touches, $t$ (ms)")
    _mark_peak(axes[0], milliseconds, normal[leg])
    if len(axes) == 2:
        _mark_peak(axes[1], milliseconds, np.asarray(found.forces[leg].tangential))
    if both.size:
        axes[0].legend(handles=[axes[0].patches[-1]], loc="best", fontsize="small")


def _mark_peak(ax: Axes, t: np.ndarray, force: np.ndarray) -> None:
    peak = int(np.argmax(np.abs(force)))
    ax.annotate(
        f"{force[peak]:.4g} N".replace("-", "−"),
        (float(t[peak]), float(force[peak])),
        xytext=(7, 3 if force[peak] > 0.0 else -3),
        textcoords="offset points",
        fontsize="small",
        va="bottom" if force[peak] > 0.0 else "top",
    )
