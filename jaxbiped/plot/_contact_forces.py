"""Contact forces over time, and one heel strike enlarged (paper, figure 8)."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jaxbiped._checks import ArgumentError
from jaxbiped.plot._samples import Contacts, Samples, contacts, heel_strikes, sampled
from jaxbiped.plot._style import (
    LEG_COLOURS,
    LEG_NAMES,
    LEG_STYLES,
    SHADE_COLOUR,
    dress,
    legend_above,
    new_figure,
)
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._trajectory import Trajectory

_BEFORE, _AFTER = 0.5e-3, 4.5e-3
"""What is enlarged around a heel strike [s]."""
_NORMAL = "normal force, $F_N$ (N)"
_TANGENTIAL = "tangential force, $F_T$ (N)"


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
    Drawn at the solver's own steps and between them, so that no peak is missed.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        figure: empty figure or subfigure to draw into; a new one unless given.
        strike: which heel strike to enlarge, counted from 0, or from the last: -1. A motion
            without a heel strike has no right-hand column.

    Raises:
        ValueError: the trajectory was not saved step by step, or has fewer heel strikes.
    """
    samples = sampled(trajectory)
    found = contacts(scene, samples.state)
    strikes = heel_strikes(samples, found)
    if strikes and not -len(strikes) <= strike < len(strikes):
        raise ArgumentError(
            f"strike = {strike} is not allowed: this motion has {len(strikes)} heel strikes."
        )
    rows = 1 if found.forces.foot_1.tangential is None else 2
    columns = 2 if strikes else 1
    if figure is None:
        figure = new_figure(4.6 * columns, 1.0 + 2.2 * rows)
    axes = figure.subplots(
        rows, columns, sharex="col", squeeze=False, width_ratios=[1.35, 1.0][:columns]
    )
    _draw_column(axes[:, 0], samples.t, found, LEG_STYLES[:1] * 2)
    axes[0, 0].margins(x=0.01)
    dress(axes[0, 0], "Contact forces", "", _NORMAL)
    legend_above(axes[0, 0])
    if rows == 2:
        dress(axes[1, 0], "", "", _TANGENTIAL)
    axes[-1, 0].set_xlabel("time, $t$ (s)")
    if strikes:
        _draw_strike(axes[:, 1], scene, trajectory, *strikes[strike])
    whole = figure.figure
    assert isinstance(whole, Figure)
    return whole


def _draw_column(axes: Any, t: np.ndarray, found: Contacts, styles: tuple[Any, ...]) -> None:
    for k, force in enumerate(found.forces):
        look: dict[str, Any] = {
            "color": LEG_COLOURS[k],
            "linestyle": styles[k],
            "linewidth": 1.1,
            "label": LEG_NAMES[k],
        }
        axes[0].plot(t, force.normal, **look)
        if force.tangential is not None:
            axes[1].plot(t, force.tangential, **look)


def _draw_strike(axes: Any, scene: Scene, trajectory: Trajectory, time: float, leg: int) -> None:
    near: Samples = sampled(trajectory, start=time - _BEFORE, stop=time + _AFTER)
    found = contacts(scene, near.state)
    milliseconds = (near.t - time) * 1e3
    _draw_column(axes, milliseconds, found, LEG_STYLES)
    both = milliseconds[
        found.touching[0]
        & found.touching[1]
        & (found.forces.foot_1.normal > 0)
        & (found.forces.foot_2.normal > 0)
    ]
    for row, ax in enumerate(axes):
        if both.size:
            ax.axvspan(both[0], both[-1], color=SHADE_COLOUR, linewidth=0, zorder=0)
        ax.margins(x=0.0)
        dress(ax, "", "", "")
        if row == 0:
            _title_strike(ax, milliseconds, found, time, leg)
    axes[-1].set_xlabel("time after the foot touches (ms)")


def _title_strike(ax: Axes, t: np.ndarray, found: Contacts, time: float, leg: int) -> None:
    normal = found.forces[leg].normal
    peak = int(np.argmax(normal))
    ax.set_title(f"Heel strike of {LEG_NAMES[leg]} at {time:.3f} s", loc="left", fontsize="medium")
    ax.annotate(
        f"peak {normal[peak]:.4g} N",
        (t[peak], normal[peak]),
        xytext=(8, 2),
        textcoords="offset points",
        fontsize="small",
        va="bottom",
    )
    ax.set_ylim(top=1.12 * normal[peak])
