"""Work against precision: cost over the error reached, a band of their own for what failed."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.plot.style import GROUND_COLOUR, SHADE_COLOUR, axes_or_new, dress, figure_of

COSTS = {
    "cpu_s": "CPU time of a run (s)",
    "seconds": "time of a run (s)",
    "attempted": "attempted steps (–)",
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_MARKERS = "osD^vPX"
_BAND = 0.12
"""Width of the band of failures, in parts of the axis."""


def work_precision(
    rows: Sequence[Mapping[str, Any]],
    axis: str,
    *,
    cost: str = "cpu_s",
    floor: float | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draws what each way costs for the error that it has, both on logarithmic scales.

    A line for each way through its settings. What failed stands as a cross in a shaded band at the
    right, at its cost (at the bottom where nothing ran). Below the floor no error is known.

    Args:
        rows: as `jaxbiped trade --json` writes them: `way`, `setting`, `outcome`, `errors`, and
            the costs. Rows that have other axes only are left out.
        axis: name of the error axis, such as "state".
        cost: "cpu_s", "seconds" or "attempted".
        floor: error by which the references disagree, in the axis's units.
        ax: where to draw; a new figure unless given.

    Returns:
        The figure.

    Raises:
        ArgumentError: an unknown cost, or no row that has the axis.
    """
    check_choice("cost", cost, COSTS)
    ways = list(dict.fromkeys(row["way"] for row in rows if _error(row, axis) is not None))
    if not ways:
        raise ArgumentError(f"rows have no error of axis = {axis!r}: there must be one at least.")
    ax = axes_or_new(ax, 7.0, 5.0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    for k, way in enumerate(ways):
        mine = [row for row in rows if row["way"] == way and _is_shown(row, axis, cost)]
        ax.plot(
            np.array([_error(row, axis) for row in mine], dtype=float),
            np.array([row[cost] for row in mine], dtype=float),
            marker=_MARKERS[k // len(_COLOURS) % len(_MARKERS)],
            color=_COLOURS[k % len(_COLOURS)],
            linestyle="-" if k < len(_COLOURS) else "--",
            markersize=4,
            linewidth=1.0,
            label=way,
        )
    if floor is not None and floor > 0.0:
        ax.set_xlim(left=min(ax.get_xlim()[0], 0.3 * floor))
        ax.axvspan(ax.get_xlim()[0], floor, color="#F3F3F3", zorder=0)
        ax.axvline(floor, color=GROUND_COLOUR, linestyle=":", label="the references' disagreement")
    failed = [
        row
        for row in rows
        if row["outcome"] != "ok" and (axis in row["errors"] or not row["errors"])
    ]
    if failed:
        _draw_failures(ax, failed, cost, ways)
    dress(ax, "", f"error of {axis.replace('_', ' ')}, relative", COSTS[cost])
    return figure_of(ax)


def _draw_failures(
    ax: Axes, failed: Sequence[Mapping[str, Any]], cost: str, ways: Sequence[str]
) -> None:
    """Crosses in the band at the right."""
    low, high = np.log10(ax.get_xlim())
    # The band lies beyond the axis as it was, whose upper end is its left edge.
    edge, right = 10.0**high, 10.0 ** (high + _BAND * (high - low) / (1.0 - _BAND))
    ax.axvspan(edge, right, color=SHADE_COLOUR, zorder=0)
    ax.set_xlim(10.0**low, right)
    bottom = ax.get_ylim()[0]
    places = np.geomspace(edge, right, len(failed) + 2)[1:-1]
    for place, row in zip(places, failed, strict=True):
        known = row["way"] in ways
        ax.plot(
            [place],
            [row[cost] if row[cost] else bottom],
            "x",
            color=_COLOURS[ways.index(row["way"]) % len(_COLOURS)] if known else GROUND_COLOUR,
            markersize=5,
        )
    ax.text(
        1.0 - 0.5 * _BAND, 1.01, "failed", transform=ax.transAxes, ha="center", fontsize="small"
    )


def _is_shown(row: Mapping[str, Any], axis: str, cost: str) -> bool:
    return row["outcome"] == "ok" and bool(_error(row, axis)) and bool(row[cost])


def _error(row: Mapping[str, Any], axis: str) -> float | None:
    found = row["errors"].get(axis)
    return None if found is None else float(found)
