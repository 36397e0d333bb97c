"""Fractions of a basin's starts with each label, along a parameter."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_positive
from jaxbiped._quantity import Quantity
from jaxbiped.basins._label_statistics import Fraction, wilson_interval
from jaxbiped.plot import style
from jaxbiped.plot._symbols import axis_label


def basin_fractions(
    values: npt.ArrayLike,
    fractions: Sequence[Mapping[str, Fraction]],
    *,
    name: str | Quantity,
    unit: str = "",
    kind: str = "lines",
    confidence: float = 0.95,
    log: bool = False,
    ax: Axes | None = None,
) -> Figure:
    """Draws the fraction of starts with each label against a parameter.

    The bands around the lines are Wilson's intervals of the counts (see `wilson_interval`). A label
    that did not occur at a value has the fraction 0 there.

    Args:
        values: values of the parameter, increasing, shape (n,).
        fractions: result of `jaxbiped.basins.fractions` at each value.
        name, unit: name and unit of the parameter. A parameter's own name, such as "K", needs no
            unit; nor does a `jaxbiped.laws.Quantity`.
        kind: "lines", or "stacked": areas that add up to one, without bands.
        confidence: confidence level of the bands.
        log: whether the parameter's axis is logarithmic.
        ax: axes to draw into. Default: a new figure.

    Returns:
        The figure that holds `ax`, or the new one.

    Raises:
        ArgumentError: there is no value, the number of fractions differs, values do not increase or
            are not above 0 on a logarithmic axis, there is only one value to stack, or nothing is
            labelled at a value.
    """
    check_choice("kind", kind, ("lines", "stacked"))
    along = _check(values, fractions, log)
    if kind == "stacked" and along.size == 1:
        raise ArgumentError("values has one entry: a stacked figure must have at least 2.")
    labels = style.in_order({label for found in fractions for label in found})
    counts = np.asarray(
        [[found[name].count if name in found else 0 for found in fractions] for name in labels]
    )
    totals = counts.sum(axis=0)
    parts, colours = counts / totals, [style.label_colour(label) for label in labels]
    ax = style.axes_or_new(ax, 7.2, 4.0)
    title, margin, order = "Fractions of the starts", 0.0, -1
    if kind == "stacked":
        edges: dict[str, Any] = {"edgecolor": "white", "linewidth": 0.4}
        ax.stackplot(along, parts, labels=labels, colors=colours, **edges)
    else:
        title += f" (bands: {100.0 * confidence:.4g} % confidence)"
        margin, order = 0.02, 1
        bands = zip(*wilson_interval(counts, totals, confidence=confidence), strict=True)
        for label, colour, part, band in zip(labels, colours, parts, bands, strict=True):
            ax.fill_between(along, *band, color=colour, alpha=0.25, linewidth=0.0)
            look: dict[str, Any] = {"marker": style.label_marker(label), "markersize": 4.0}
            ax.plot(along, part, color=colour, label=label, clip_on=False, **look)
    style.dress(ax, title, axis_label(name, unit), "fraction of the starts")
    if log:
        ax.set_xscale("log")
    if along.size > 1:
        ax.set_xlim(along[0], along[-1])
    ax.set_ylim(-margin, 1.0 + margin)
    handles, entries = ax.get_legend_handles_labels()
    style.legend_right(ax, handles=handles[::order], labels=entries[::order])
    return style.figure_of(ax)


def _check(
    values: npt.ArrayLike, fractions: Sequence[Mapping[str, Fraction]], log: bool
) -> np.ndarray:
    check_finite("values", values)
    along = np.asarray(values, dtype=float)
    if along.ndim != 1 or along.size == 0 or along.size != len(fractions):
        raise ArgumentError(
            f"values has shape {along.shape} and there are {len(fractions)} fractions: there must "
            "be one for each value, and at least one."
        )
    if (np.diff(along) <= 0.0).any():
        raise ArgumentError("values does not increase everywhere: it must.")
    if log:
        check_positive("values", along)
    empty = [k for k, found in enumerate(fractions) if not found]
    if empty:
        raise ArgumentError(
            f"fractions[{empty[0]}] is empty: at least one start must be labelled at each value."
        )
    return along
