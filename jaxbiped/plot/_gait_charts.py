"""Charts of a gait's elasticities, as tornados; and which gaits can be drawn, with which errors."""

import math
from typing import Any

import jax.tree_util as jtu
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import QUANTITIES, Gait
from jaxbiped.plot import style
from jaxbiped.plot._symbols import row_label

_LINEAR = 1e-4
"""Elasticities up to this are drawn to a linear scale, beyond to a logarithmic one."""
_READING = """One per cent more of a parameter
changes the measure by as many
per cent as its elasticity.

Blue: the measure grows;
vermilion: it shrinks.

The scale is logarithmic beyond
±0.0001, and the same in all panels."""


def check_drawable(gait: Gait) -> None:
    """Raises `ArgumentError` for a batch of gaits, or where no gait was found."""
    check_type("gait", gait, Gait)
    if np.ndim(gait.ending) != 0:
        raise ArgumentError("this is a batch of gaits: draw one of them.")
    if gait.outcome is not Search.FOUND:
        raise ArgumentError(f"the search ended {str(gait.outcome)!r}: there is no gait to draw.")


def error_bars(gait: Gait, of: str) -> Any:
    """Estimated errors of a gait's `multipliers` or `sensitivities`.

    Of an accuracy that was asked for by a number they are the ones that the gait then has.
    """
    if gait.error is not None and of in gait.error.bars:
        return gait.error.bars[of]
    return gait.multiplier_errors if of == "multipliers" else gait.sensitivity_errors


def elasticity_errors(gait: Gait, name: str) -> np.ndarray:
    """Estimated errors of the elasticities of a measure, shape (p,); NaN where none is known.

    An elasticity is a sensitivity times the parameter over the measure, and has their relative
    errors.
    """
    parts = gait.sensitivities, gait.measures, gait.elasticities, gait.measure_errors
    # By NumPy: JAX would compile a program for each of what follows.
    slopes, measures, relative_slopes, errors = jtu.tree_map(np.asarray, parts)
    bars = np.asarray(getattr(error_bars(gait, "sensitivities"), name))
    value, own = getattr(measures, name), getattr(relative_slopes, name)
    with np.errstate(divide="ignore", invalid="ignore"):
        # The parameter itself, from any measure that it changes.
        sizes = [
            np.abs(getattr(relative_slopes, each) * getattr(measures, each))
            / np.abs(getattr(slopes, each))
            for each in QUANTITIES
        ]
        parameter = np.nanmax(np.where(np.isfinite(sizes), sizes, 0.0), axis=0)
        relative = np.abs(getattr(errors, name) / value)
        found = parameter * bars / np.abs(value) + np.abs(own) * relative
    return np.where(np.isfinite(own) & np.isfinite(found), found, np.nan)


def elasticities(
    gait: Gait, measure: str | tuple[str, ...] | None = None, *, ax: Axes | None = None
) -> Figure:
    """Draws elasticities, d log measure / d log parameter, with error bars, the largest on top.

    A bar to the right means that the measure grows with the parameter. The scale is linear up to
    1e-4 on either side of zero, and logarithmic beyond. The numbers are at the right.

    Args:
        gait: a gait that was found, with its sensitivities to some parameters.
        measure: one or several of "period", "step_length", "speed", "peak_normal" and
            "spectral_radius", a panel each. Default: all with known elasticities.
        ax: axes to draw one measure into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: no gait was found, this is a batch, a measure is unknown, several are given with
            one pair of axes, or the gait has no parameters.
    """
    check_drawable(gait)
    if measure is None:
        # Those that are known and not zero; all of them if none has one.
        own = {name: np.nan_to_num(getattr(gait.elasticities, name)) for name in QUANTITIES}
        measure = tuple(name for name in own if own[name].any()) or tuple(QUANTITIES)
    names = (measure,) if isinstance(measure, str) else tuple(measure)
    if not names:
        raise ArgumentError("measure = () is not allowed: it must name a measure at least.")
    for name in names:
        check_choice("measure", name, QUANTITIES)
    if not gait.parameters:
        raise ArgumentError("this gait has no sensitivities: find it with parameters to vary.")
    if ax is not None and len(names) > 1:
        raise ArgumentError("ax is one pair of axes: it shows the elasticities of one measure.")
    rows, short = _row_labels(gait)
    if ax is not None:
        panels = [ax]
    else:
        beside = max(style.text_size(row)[0] for row in rows) / style.letter_size()
        most = min(len(names), 3 if beside < 2.0 else 2)
        columns = style.panels_abreast(most, width=1.9 if short else 2.2 + beside)
        lines = -(-len(names) // columns)
        width, height = max(3.9, 2.2 + beside) * columns, (1.3 + 0.2 * len(rows)) * lines
        figure = style.new_figure(max(width, 4.6), height, rows=True)
        panels = list(figure.subplots(lines, columns, squeeze=False).flat)
    found = [np.asarray(getattr(gait.elasticities, name)) for name in names]
    errors = [elasticity_errors(gait, name) for name in names]
    ends = np.abs(np.nan_to_num(found, posinf=0.0, neginf=0.0)) + np.nan_to_num(errors)
    for each, name, values, bars in zip(panels, names, found, errors, strict=False):
        _panel(each, QUANTITIES[name].words, rows, values, bars)
    style.figure_of(panels[0]).draw_without_rendering()  # lays out, so that widths are known
    for panel in panels[: len(names)]:
        _scale(panel, float(np.max(ends)))
    spare = panels[len(names) :]
    for each in spare:
        each.set_axis_off()
    if spare and style.has_titles():
        look: dict[str, Any] = {"fontsize": "small", "color": style.GROUND_COLOUR, "va": "top"}
        spare[0].text(-0.4, 0.95, _READING, transform=spare[0].transAxes, **look)
    return style.figure_of(panels[0])


def _row_labels(gait: Gait) -> tuple[list[str], bool]:
    """What the parameters are called, and whether by their symbols alone: in the style of a paper,
    whose text explains them, where these differ. Parameters of a body are told by its name."""
    symbols = {each.symbol for each in gait.quantities} - {""}
    told = len(symbols) == len(gait.parameters) and not any("." in n for n in gait.parameters)
    if not style.has_titles() and told:
        return [each.symbol for each in gait.quantities], True
    return [row_label(each) for each in gait.quantities or gait.parameters], False


def _panel(ax: Axes, title: str, names: list[str], values: np.ndarray, errors: np.ndarray) -> None:
    """One measure: bars from the largest down, unknown ones last, and their numbers beside.

    Thin lines are their errors.
    """
    order = np.argsort(-np.where(np.isfinite(values), np.abs(values), -1.0), kind="stable")
    values, errors = values[order], errors[order]
    drawn, places = np.nan_to_num(values, posinf=0.0, neginf=0.0), np.arange(len(values))
    colours = [style.LEG_COLOURS[int(value < 0.0)] for value in drawn]
    look: dict[str, Any] = {"ecolor": "black", "elinewidth": 0.9, "capsize": 1.5}
    ax.barh(places, drawn, color=colours, height=0.7, xerr=errors, error_kw=look)
    ax.axvline(0.0, color=style.GROUND_COLOUR, linewidth=0.8)
    ax.set_yticks(places, [names[i] for i in order], fontsize="small")
    ax.set_ylim(len(values) - 0.4, -0.6)
    look = {"fontsize": "x-small", "color": style.GROUND_COLOUR, "va": "center"}
    for place, value in enumerate(values):
        text = "0" if value == 0.0 else f"{value:+.2g}".replace("-", "−")
        text = "unknown" if np.isnan(value) else text
        ax.text(1.02, place, text, transform=ax.get_yaxis_transform(), **look)
    style.set_title(ax, title, panel=True)
    label = "d log measure / d log parameter" if style.has_titles() else "elasticity (–)"
    ax.set_xlabel(label, fontsize="small")
    ax.grid(axis="x", color="#E6E6E6", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.tick_params(axis="y", length=0)


def _scale(ax: Axes, largest: float) -> None:
    """The same reach on both sides; ticks at its largest power of ten and, if there is room for
    their labels, at a hundredth of that."""
    ax.set_xscale("symlog", linthresh=_LINEAR, linscale=0.5)
    reach = max(1.6 * largest, 10.0 * _LINEAR)
    ax.set_xlim(-reach, reach)
    top = math.floor(math.log10(reach) + 1e-9)
    marks, outer = {0.0: "0"}, np.inf
    for power in (10.0**k for k in (top, top - 2) if 10.0**k >= 10.0 * _LINEAR):
        ticks = {-power: f"−{power:g}", power: f"{power:g}"}
        places = ax.transData.transform([(x, 0.0) for x in (-outer, -power, 0.0) if np.isfinite(x)])
        gap = float(np.diff(places[:, 0]).min()) / style.figure_of(ax).dpi
        if gap > style.text_size(ticks[-power])[0] + 0.05:
            marks, outer = marks | ticks, power
    ax.set_xticks(list(marks), list(marks.values()), fontsize="small")
