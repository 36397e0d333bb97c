"""The periodic orbit of a gait in phase space."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped.gait._gait import Gait
from jaxbiped.plot._arrows import direction_arrows
from jaxbiped.plot._multipliers import check_drawable
from jaxbiped.plot._symbols import LEG_ANGLE, LEG_RATE
from jaxbiped.plot.style import (
    LEG_COLOURS,
    LEG_NAMES,
    LEG_STYLES,
    axes_or_new,
    dress,
    figure_of,
    legend_above,
)


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
    ax = axes_or_new(ax, 5.6, 4.4)
    start = gait.measures.state
    begins = ((start.theta_1, start.omega_1), (start.theta_2, start.omega_2))
    for k, (angle, rate) in enumerate(_legs(gait)):
        ax.plot(
            angle,
            rate,
            color=LEG_COLOURS[k],
            linestyle=LEG_STYLES[k],
            linewidth=1.1,
            label=LEG_NAMES[k],
        )
        direction_arrows(ax, angle, rate, LEG_COLOURS[k])
        ax.plot(*map(float, begins[k]), "o", color=LEG_COLOURS[k], markersize=6)
    dress(
        ax,
        "Periodic orbit (dots: on the section)",
        LEG_ANGLE.on_axis(),
        LEG_RATE.on_axis(),
    )
    legend_above(ax)
    return figure_of(ax)


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
