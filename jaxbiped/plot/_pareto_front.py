"""Figure of a Pareto front with its tangents."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxbiped._checks import check_type
from jaxbiped.optimise._pareto_front import ParetoFront
from jaxbiped.plot import style

_TANGENT = 0.03
"""Half the length of a tangent along the bounds, as a share of their range."""


def pareto_front(front: ParetoFront) -> Figure:
    """Draws the best objective against the value of the other measure.

    Each point has its error bar and the front's tangent, whose slope is the bound's multiplier.
    Filled marks are certified optima. Open marks are not certified, or dominated by another point.
    A point whose bound does not hold it has no tangent.

    Args:
        front: a front from `pareto_front`.

    Returns:
        A new figure.

    Raises:
        ArgumentError: `front` is not a `ParetoFront`.
    """
    check_type("front", front, ParetoFront)
    against, goal = front.optima[0].quantities[front.against], front.quantity
    figure = style.new_figure(4.4, 3.2)
    ax = figure.subplots()
    (objectives, errors), values = front.objectives, front.values(front.against)
    reach = _TANGENT * max(np.ptp(values), 1e-9 * abs(values[0]))
    good = front.proven & ~front.dominated
    colour = style.LEG_COLOURS[0]
    for place in np.flatnonzero(front.holds):
        along = values[place] + reach * np.array([-1.0, 1.0])
        tangent = objectives[place] + front.slopes[0, place] * (along - values[place])
        ax.plot(along, tangent, color=style.LEG_COLOURS[1], linewidth=1.2, zorder=3)
    for chosen, look in ((good, colour), (~good, "white")):
        marks: dict[str, Any] = {"color": colour, "markerfacecolor": look, "markersize": 4}
        bars = errors[chosen]
        ax.errorbar(values[chosen], objectives[chosen], bars, fmt="o", capsize=2.0, **marks)
    labels = (
        f"{quantity.symbol or quantity.words} ({quantity.unit_in_figure})"
        for quantity in (against, goal)
    )
    style.dress(ax, f"best {goal.words} against {against.words}", *labels)
    return figure
