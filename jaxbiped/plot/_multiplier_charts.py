"""Charts of Floquet multipliers in the complex plane: of a gait, and their paths along a branch."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import BranchPoint
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.plot import style
from jaxbiped.plot._gait_charts import check_drawable, error_bars
from jaxbiped.plot._parameter_charts import EVENT_MARKS
from jaxbiped.scene._parameter_access import parameter_quantities

_NEAR_ZERO = 0.03
"""Multipliers closer to zero than this are named together."""
_VISIBLE = 0.005
"""Errors below this hide behind a dot."""
_VERDICTS = {True: "stable", False: "not stable", None: "undecided within the errors"}
_FARTHEST = 3.0
"""Modulus at which the picture of a branch ends, so that the unit circle remains visible."""


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
