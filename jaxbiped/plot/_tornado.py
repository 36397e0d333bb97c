"""Tornado charts of elasticities: which parameter moves a gait how much."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._quantity import Quantity
from jaxbiped.gait._gait import Gait
from jaxbiped.plot._multipliers import check_drawable
from jaxbiped.plot._symbols import row_label
from jaxbiped.plot.style import GROUND_COLOUR, LEG_COLOURS, new_figure

MEASURES = {
    "period": "period",
    "step_length": "step length",
    "speed": "speed",
    "peak_normal": "peak normal force",
    "spectral_radius": "spectral radius",
}
_LINEAR = 1e-4
"""Elasticities up to this are drawn to a linear scale, beyond to a logarithmic one."""


_READING = """One per cent more of a parameter
changes the measure by as many
per cent as its elasticity.

Blue: the measure grows;
vermilion: it shrinks.

The scale is logarithmic beyond
±0.0001, and the same in all panels."""


def elasticities(gait: Gait, measure: str | tuple[str, ...] = tuple(MEASURES)) -> Figure:
    """Draws elasticities, d log measure / d log parameter, the largest on top.

    A bar to the right: the measure grows with the parameter. The scale is logarithmic beyond
    1e-4 on either side of zero; the numbers stand at the right.

    Args:
        gait: a gait that was found, with its sensitivities to some parameters.
        measure: one or several of "period", "step_length", "speed", "peak_normal" and
            "spectral_radius", a panel each; all of them unless given.

    Returns:
        A new figure.

    Raises:
        ValueError: no gait was found, this is a batch, a measure that is not one of those, or
            a gait without parameters.
    """
    names = (measure,) if isinstance(measure, str) else tuple(measure)
    if not names:
        raise ArgumentError("measure = () is not allowed: it must name a measure at least.")
    for name in names:
        check_choice("measure", name, MEASURES)
    check_drawable(gait)
    if not gait.parameters:
        raise ArgumentError("this gait has no sensitivities: find it with parameters to vary.")
    columns = min(len(names), 3)
    rows = -(-len(names) // columns)
    height = 1.3 + 0.2 * len(gait.parameters)
    figure = new_figure(max(3.9 * columns, 4.6), height * rows)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    values = {name: np.asarray(getattr(gait.elasticities, name)) for name in names}
    largest = max(float(np.max(np.abs(_finite(each)))) for each in values.values())
    for ax, name in zip(panels, names, strict=False):
        _panel(ax, MEASURES[name], gait.quantities or gait.parameters, values[name])
        _scale(ax, largest)
    spare = panels[len(names) :]
    for ax in spare:
        ax.set_axis_off()
    if spare:
        spare[0].text(0.0, 0.95, _READING, va="top", fontsize="small", color=GROUND_COLOUR)
    return figure


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, 0.0)


def _panel(
    ax: Axes, title: str, parameters: tuple[str | Quantity, ...], values: np.ndarray
) -> None:
    """One measure: bars from the largest down, unknown ones last."""
    order = np.argsort(-np.where(np.isfinite(values), np.abs(values), -1.0), kind="stable")
    values = values[order]
    drawn = _finite(values)
    places = np.arange(len(values))
    colours = [LEG_COLOURS[0] if value >= 0.0 else LEG_COLOURS[1] for value in drawn]
    ax.barh(places, drawn, color=colours, height=0.7)
    ax.axvline(0.0, color=GROUND_COLOUR, linewidth=0.8)
    ax.set_yticks(places, [row_label(parameters[i]) for i in order], fontsize="small")
    ax.set_ylim(len(values) - 0.4, -0.6)
    _numbers(ax, places, values)
    ax.set_title(title, loc="left", fontsize="medium")
    ax.set_xlabel("d log measure / d log parameter", fontsize="small")
    ax.grid(axis="x", color="#E6E6E6", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.tick_params(axis="y", length=0)


def _scale(ax: Axes, largest: float) -> None:
    """The same reach on both sides, a tick every other decade."""
    ax.set_xscale("symlog", linthresh=_LINEAR, linscale=0.5)
    reach = max(1.6 * largest, 10.0 * _LINEAR)
    ax.set_xlim(-reach, reach)
    powers = [10.0**k for k in range(6, -4, -2) if 10.0**k <= reach]
    ax.set_xticks(
        [*(-power for power in powers), 0.0, *reversed(powers)],
        [*(f"−{power:g}" for power in powers), "0", *(f"{power:g}" for power in reversed(powers))],
        fontsize="small",
    )
    ax.xaxis.set_minor_locator(NullLocator())


def _numbers(ax: Axes, places: np.ndarray, values: np.ndarray) -> None:
    """The elasticities as numbers, in a column right of the bars."""
    for place, value in zip(places, values, strict=True):
        ax.text(
            1.02,
            place,
            _format(value),
            transform=ax.get_yaxis_transform(),
            va="center",
            fontsize="x-small",
            color=GROUND_COLOUR,
        )


def _format(value: float) -> str:
    if np.isnan(value):
        return "unknown"
    return "0" if value == 0.0 else f"{value:+.2g}".replace("-", "−")
