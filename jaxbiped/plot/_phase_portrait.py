"""Phase portrait of a leg (paper, figure 5)."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError
from jaxbiped.plot._samples import sampled
from jaxbiped.plot._style import (
    LEG_COLOURS,
    LEG_NAMES,
    LEG_STYLES,
    axes_or_new,
    dress,
    figure_of,
    legend_above,
)
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._trajectory import Trajectory


def phase_portrait(
    scene: Scene,
    trajectory: Trajectory,
    *,
    ax: Axes | None = None,
    legs: tuple[int, ...] = (1,),
) -> Figure:
    """Draws the rate of a leg [rad/s] over its angle from the slope's normal [rad].

    A leg swings forward along the upper half and carries the walker along the lower one; the
    two near-vertical ends are its heel strike (right) and its lifting (left). A dot is the start.

    Args:
        scene: what was simulated.
        trajectory: the motion, saved step by step.
        ax: axes to draw into; a new figure unless given.
        legs: which legs to draw: (1,), (2,) or (1, 2).

    Raises:
        ValueError: the trajectory was not saved step by step, or a leg of another number.
    """
    if not legs or not set(legs) <= {1, 2}:
        raise ArgumentError(f"legs = {legs!r} is not allowed: it must name legs 1, 2 or both.")
    state = sampled(trajectory).state
    angles, rates = (state.theta_1, state.theta_2), (state.omega_1, state.omega_2)
    ax = axes_or_new(ax, 5.6, 4.4)
    for k in sorted({leg - 1 for leg in legs}):
        ax.plot(
            angles[k],
            rates[k],
            color=LEG_COLOURS[k],
            linestyle=LEG_STYLES[k],
            linewidth=1.1,
            label=LEG_NAMES[k],
        )
        ax.plot(angles[k][0], rates[k][0], "o", color=LEG_COLOURS[k], markersize=5)
    dress(
        ax,
        "Phase portrait",
        r"leg angle, $\theta$ (rad)",
        r"leg rate, $\dot\theta$ (rad/s)",
    )
    legend_above(ax)
    return figure_of(ax)
