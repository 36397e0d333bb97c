"""Charts of a gait: elasticities as tornados, Floquet multipliers in the complex plane."""

import math
from typing import Any

import jax.tree_util as jtu
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import QUANTITIES, Gait
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.plot import style
from jaxbiped.plot._parameter_charts import EVENT_MARKS
from jaxbiped.plot._symbols import row_label
from jaxbiped.scene._parameter_access import parameter_quantities

_LINEAR = 1e-4
"""Elasticities up to this are drawn to a linear scale, beyond to a logarithmic one."""
_READING = """One per cent more of a parameter
changes the measure by as many
per cent as its elasticity.

Blue: the measure grows;
vermilion: it shrinks.

The scale is logarithmic beyond
±0.0001, and the same in all panels."""
_NEAR_ZERO = 0.03
"""Multipliers closer to zero than this are named together."""
_VISIBLE = 0.005
"""Errors below this hide behind a dot."""
_VERDICTS = {True: "stable", False: "not stable", None: "undecided within the errors"}
_FARTHEST = 3.0
"""Modulus at which the picture of a branch ends, so that the unit circle remains visible."""


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


def multipliers(gait: Gait | BranchPoint | Branch, *, ax: Axes | None = None) -> Figure:
    """Draws the Floquet multipliers with their error bars, without the trivial one.

    The circle is the unit circle, within which a gait is stable. A disc around a multiplier is its
    estimated error, if that is larger than the dot. Multipliers near zero lie on top of each other
    and share a label.

    For a branch, the multipliers of all its gaits are drawn as paths without error bars, coloured
    by the parameter. Both ends and the bifurcations are marked. The picture ends at a modulus of 3.

    Args:
        gait: a gait that was found, a point of a branch, or a branch.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ValueError: no gait was found, this is a batch, or a branch has no points.
    """
    check_type("gait", gait, Gait, BranchPoint, Branch)
    if isinstance(gait, Branch):
        return _paths(gait, ax)
    if isinstance(gait, BranchPoint):
        errors, stable = np.asarray(gait.multiplier_errors), gait.stable
        critical = Bifurcation(gait.bifurcation)
    else:
        check_drawable(gait)
        errors = np.asarray(error_bars(gait, "multipliers"))
        stable, critical = bool(gait.stable), gait.critical
    values = np.asarray(gait.multipliers)
    bars = np.where(np.isfinite(errors), errors, np.nan)
    ax = style.axes_or_new(ax, 5.6, 5.6)
    _frame(ax, max(1.0, float(np.max(np.abs(values) + np.nan_to_num(bars)))))
    for value, error in zip(values, errors, strict=True):
        if _VISIBLE < error < np.inf:
            place = (value.real, value.imag)
            ax.add_patch(Circle(place, error, facecolor=style.LEG_COLOURS[1], alpha=0.25))
    look: dict[str, Any] = {"color": style.LEG_COLOURS[0], "elinewidth": 0.9, "capsize": 2.0}
    ax.errorbar(values.real, values.imag, bars, bars, fmt="none", **look)
    look = {"color": style.LEG_COLOURS[0], "markersize": 5}
    ax.plot(values.real, values.imag, "o", label="multipliers", **look)
    _name(ax, values)
    largest = float(np.max(errors))
    said = f"largest error {largest:.1e}" + ("" if largest > _VISIBLE else ": within the dots")
    said = said if np.isfinite(largest) else "not all errors are known"
    look = {"fontsize": "small", "color": style.GROUND_COLOUR}
    ax.text(0.02, 0.02, said, transform=ax.transAxes, **look)
    verdict = _VERDICTS[stable]
    if critical is not Bifurcation.NONE:
        verdict += f", at a bifurcation ({critical})"
    radius = float(np.max(np.abs(values)))
    style.set_title(ax, f"Floquet multipliers: spectral radius {radius:.4f}\n{verdict}")
    return style.figure_of(ax)


def _paths(branch: Branch, ax: Axes | None) -> Figure:
    """The multipliers along a branch, coloured by its parameter, in their order of arclength."""
    if not len(branch):
        raise ArgumentError("gait is a branch without points: there is nothing to draw.")
    paths, values = _followed(branch.multipliers), branch.values
    ax = style.axes_or_new(ax, 6.6, 5.6)
    _frame(ax, min(_FARTHEST, max(1.0, float(np.max(np.abs(paths))))))
    scale = LogNorm if branch.axis.log else Normalize
    colours: dict[str, Any] = {"norm": scale(values.min(), values.max()), "cmap": "viridis"}
    places = np.stack([paths.real, paths.imag], axis=-1)
    for path in np.swapaxes(places, 0, 1):
        parts: Any = np.stack([path[:-1], path[1:]], axis=1)
        lines = LineCollection(parts, array=0.5 * (values[:-1] + values[1:]), **colours)
        ax.add_collection(lines, autolim=False)
    each_value = np.repeat(values, paths.shape[1])
    dots = ax.scatter(paths.real.ravel(), paths.imag.ravel(), 6, each_value, **colours)
    start, end = places[[0, -1]]
    black: dict[str, Any] = {"linestyle": "none", "color": "black"}
    ax.plot(*start.T, "o", label="start", markerfacecolor="white", markersize=7, **black)
    ax.plot(*end.T, "s", label="end", markersize=4, **black)
    look: dict[str, Any] = {"linestyle": "none", "color": style.LEG_COLOURS[1], "markersize": 6}
    for event in branch.bifurcations:
        marker, words = EVENT_MARKS[event.kind]
        at = np.array([event.multiplier, np.conj(event.multiplier)])
        ax.plot(at.real, at.imag, marker=marker, label=words, **look)
    along = parameter_quantities(branch.scene)[branch.along]
    figure = style.figure_of(ax)
    side = "top" if style.is_narrow() else "right"
    figure.colorbar(dots, ax=ax, label=along.on_axis(), shrink=0.8, location=side)
    style.set_title(ax, f"Floquet multipliers along {along.words}")
    handles = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    style.legend_below(ax, columns=len(handles), handles=list(handles.values()))
    return figure


def _followed(multipliers: np.ndarray) -> np.ndarray:
    """Multipliers of points, shape (n, k), in such an order that each column is one path.

    Neighbouring points are matched so that the sum of the squared distances is smallest.
    """
    from scipy.optimize import linear_sum_assignment

    paths = [multipliers[0]]
    for row in multipliers[1:]:
        steps = np.abs(paths[-1][:, None] - row) ** 2
        paths.append(row[linear_sum_assignment(steps)[1]])
    return np.array(paths)


def _frame(ax: Axes, reach: float) -> None:
    """The unit circle, equal scales, both axes through zero, room for the names."""
    look: dict[str, Any] = {"edgecolor": style.GROUND_COLOUR, "zorder": 0, "label": "unit circle"}
    ax.add_patch(Circle((0.0, 0.0), 1.0, facecolor="#F6F6F6", **look))
    ax.axhline(0.0, color=style.SHADE_COLOUR, linewidth=0.8, zorder=0.5)
    ax.axvline(0.0, color=style.SHADE_COLOUR, linewidth=0.8, zorder=0.5)
    ax.set_aspect("equal")
    ax.set_xlim(-1.15 * reach, 1.15 * reach)
    ax.set_ylim(-1.15 * reach, 1.15 * reach)
    ax.set_xlabel(r"real part, Re $\lambda$ (–)")
    ax.set_ylabel(r"imaginary part, Im $\lambda$ (–)")
    ax.spines[["top", "right"]].set_visible(False)


def _name(ax: Axes, values: np.ndarray) -> None:
    """Writes each multiplier beside its dot; of a complex pair once, those near zero together.

    A name stands in that corner of its dot from which the other dots and names, and the circle,
    are farthest.
    """
    small = np.abs(values) < _NEAR_ZERO
    names = [
        (f"{value.real:.3f} ± {value.imag:.3f} i" if value.imag else f"{value.real:.3f}", value)
        for value in values[~small & (values.imag >= 0.0)]
    ]
    if small.any():
        largest = float(np.max(np.abs(values[small])))
        names.append((f"{int(small.sum())} near 0\n" + rf"($|\lambda| \leq$ {largest:.1e})", 0j))
    circle = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 200))
    taken = [*values[~small], *([0j] if small.any() else []), *circle]
    edge = ax.get_xlim()[1]
    inches = ax.get_window_extent().width / style.figure_of(ax).dpi
    scale = 2.0 * edge / inches
    for text, value in names:
        wide, high = (scale * each for each in style.text_size(text))
        # Down the middle of each text that might be written.
        corners = {
            (right, up): value
            + right * np.linspace(0.4 * high, wide, 9)
            + 1j * up * (0.5 * high + 0.05 * scale)
            for right in (1, -1)
            for up in (1, -1)
        }
        others = np.array([each for each in taken if each != value])[:, None]
        right, up = max(corners, key=lambda each: _room(corners[each], others, edge))
        taken += list(corners[right, up])
        side, level = "left" if right > 0 else "right", "bottom" if up > 0 else "top"
        place = (value.real, value.imag)
        words = text.replace("-", "−")
        style.label_point(ax, words, place, (6 * right, 4 * up), ha=side, va=level)


def _room(text: np.ndarray, others: np.ndarray, edge: float) -> float:
    """Smallest distance of a text from others; below zero by how far it leaves the axes."""
    outside = edge - float(np.max(np.abs(text.real)))
    return min(outside, 0.0) or float(np.min(np.abs(text - others)))
