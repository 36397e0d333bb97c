"""Charts of a gait: Floquet multipliers in the complex plane, and elasticities as tornados."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import NullLocator

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped._quantity import Quantity
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.plot import style
from jaxbiped.plot._symbols import row_label

_NEAR_ZERO = 0.03
"""Multipliers closer to zero than this are named together."""
_VISIBLE = 0.005
"""Errors below this hide behind a dot."""


def check_drawable(gait: Gait) -> None:
    """Raises `ArgumentError` for a batch of gaits, or where no gait was found."""
    if np.ndim(gait.ending) != 0:
        raise ArgumentError("this is a batch of gaits: draw one of them.")
    if gait.outcome is not Search.FOUND:
        raise ArgumentError(f"the search ended {str(gait.outcome)!r}: there is no gait to draw.")


def multipliers(gait: Gait, *, ax: Axes | None = None) -> Figure:
    """Draws the Floquet multipliers, without the trivial one, and the unit circle.

    A disc about a multiplier is its estimated error, where that is larger than the dot. Those
    near zero lie on top of each other and are named together.

    Args:
        gait: a gait that was found.
        ax: axes to draw into; a new figure unless given.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: no gait was found, or this is a batch.
    """
    check_drawable(gait)
    values, errors = np.asarray(gait.multipliers), np.asarray(gait.multiplier_errors)
    ax = style.axes_or_new(ax, 5.6, 5.6)
    inside = Circle((0.0, 0.0), 1.0, facecolor="#F6F6F6", edgecolor=style.GROUND_COLOUR, zorder=0)
    ax.add_patch(inside)
    for value, error in zip(values, errors, strict=True):
        if error > _VISIBLE:
            place = (value.real, value.imag)
            ax.add_patch(Circle(place, error, facecolor=style.LEG_COLOURS[1], alpha=0.25))
    look: dict[str, Any] = {"color": style.LEG_COLOURS[0], "markersize": 5}
    ax.plot(values.real, values.imag, "o", label="multipliers", **look)
    _name(ax, values)
    _frame(ax, max(1.0, float(np.max(np.abs(values) + errors))))
    largest = float(np.max(errors))
    said = f"largest error {largest:.1e}" + ("" if largest > _VISIBLE else ": within the dots")
    look = {"fontsize": "small", "color": style.GROUND_COLOUR}
    ax.text(0.02, 0.02, said, transform=ax.transAxes, **look)
    verdict = "stable" if bool(gait.stable) else "not stable"
    if gait.critical is not Bifurcation.NONE:
        verdict += f", at a bifurcation ({gait.critical})"
    radius = float(gait.measures.spectral_radius)
    title = f"Floquet multipliers: spectral radius {radius:.4f}\n{verdict}"
    ax.set_title(title, loc="left", fontsize="medium")
    return style.figure_of(ax)


def _frame(ax: Axes, reach: float) -> None:
    """Equal scales, both axes through zero, room for the names."""
    ax.axhline(0.0, color=style.SHADE_COLOUR, linewidth=0.8, zorder=0.5)
    ax.axvline(0.0, color=style.SHADE_COLOUR, linewidth=0.8, zorder=0.5)
    ax.set_aspect("equal")
    ax.set_xlim(-1.15 * reach, 1.15 * reach)
    ax.set_ylim(-1.15 * reach, 1.15 * reach)
    ax.set_xlabel(r"real part, Re $\lambda$ (–)")
    ax.set_ylabel(r"imaginary part, Im $\lambda$ (–)")
    ax.spines[["top", "right"]].set_visible(False)


def _name(ax: Axes, values: np.ndarray) -> None:
    """Writes each multiplier beside its dot; of a complex pair once, those near zero together."""
    small = np.abs(values) < _NEAR_ZERO
    reals = 0
    for value in values[~small & (values.imag >= 0.0)]:
        if value.imag > 0.0:
            text, shift, anchor = f"{value.real:.3f} ± {value.imag:.3f} i", 6, "bottom"
        else:
            # Neighbours on the real axis are written at different depths.
            text, shift, anchor = f"{value.real:.3f}", -6 - 12 * (reals % 2), "top"
            reals += 1
        across, side = (-6, "right") if value.real > 0.6 else (6, "left")
        place = (value.real, value.imag)
        style.label_point(ax, text, place, (across, shift), ha=side, va=anchor)
    if small.any():
        largest = float(np.max(np.abs(values[small])))
        text = f"{int(small.sum())} near 0\n" + rf"($|\lambda| \leq$ {largest:.1e})"
        style.label_point(ax, text, (0.0, 0.0), (-8, -8), ha="right", va="top")


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
    figure = style.new_figure(max(3.9 * columns, 4.6), height * rows)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    found = [np.asarray(getattr(gait.elasticities, name)) for name in names]
    largest = float(np.max(np.abs(np.nan_to_num(found, posinf=0.0, neginf=0.0))))
    for ax, name, values in zip(panels, names, found, strict=False):
        _panel(ax, MEASURES[name], gait.quantities or gait.parameters, values)
        _scale(ax, largest)
    spare = panels[len(names) :]
    for ax in spare:
        ax.set_axis_off()
    if spare:
        spare[0].text(-0.4, 0.95, _READING, va="top", fontsize="small", color=style.GROUND_COLOUR)
    return figure


def _panel(
    ax: Axes, title: str, parameters: tuple[str | Quantity, ...], values: np.ndarray
) -> None:
    """One measure: bars from the largest down, unknown ones last, and their numbers beside."""
    order = np.argsort(-np.where(np.isfinite(values), np.abs(values), -1.0), kind="stable")
    values = values[order]
    drawn, places = np.nan_to_num(values, posinf=0.0, neginf=0.0), np.arange(len(values))
    colours = [style.LEG_COLOURS[int(value < 0.0)] for value in drawn]
    ax.barh(places, drawn, color=colours, height=0.7)
    ax.axvline(0.0, color=style.GROUND_COLOUR, linewidth=0.8)
    ax.set_yticks(places, [row_label(parameters[i]) for i in order], fontsize="small")
    ax.set_ylim(len(values) - 0.4, -0.6)
    look: dict[str, Any] = {"fontsize": "x-small", "color": style.GROUND_COLOUR, "va": "center"}
    for place, value in enumerate(values):
        text = "0" if value == 0.0 else f"{value:+.2g}".replace("-", "−")
        text = "unknown" if np.isnan(value) else text
        ax.text(1.02, place, text, transform=ax.get_yaxis_transform(), **look)
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
    powers = [10.0**k for k in range(-2, 7, 2) if 10.0**k <= reach]
    marks = {-power: f"−{power:g}" for power in reversed(powers)} | {0.0: "0"}
    marks |= {power: f"{power:g}" for power in powers}
    ax.set_xticks(list(marks), list(marks.values()), fontsize="small")
    ax.xaxis.set_minor_locator(NullLocator())
