"""Work against precision: cost over the error reached, and constraint methods side by side."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.plot import style

COSTS = {
    "cpu_s": "CPU time of a run (s)",
    "seconds": "time of a run (s)",
    "attempted": "attempted steps (–)",
}
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
    """Draws cost against error for each method, on logarithmic scales.

    Each method has a line through its settings. A failed run is a cross in a shaded band at the
    right, at its cost (at the bottom if nothing ran). Errors below the floor cannot be determined.

    Args:
        rows: rows as `jaxbiped trade --json` writes them: `way`, `setting`, `outcome`, `errors`,
            and the costs. Rows without this axis are left out.
        axis: name of the error axis, such as "state".
        cost: "cpu_s", "seconds" or "attempted".
        floor: error by which the references disagree, in the axis's units.
        ax: axes to draw into. Default: a new figure with a legend.

    Returns:
        The figure.

    Raises:
        ArgumentError: the cost is unknown, or no row has the axis.
    """
    check_choice("cost", cost, COSTS)
    ways = list(dict.fromkeys(row["way"] for row in rows if _error(row, axis) is not None))
    if not ways:
        raise ArgumentError(f"rows have no error of axis = {axis!r}: there must be one at least.")
    new = ax is None
    ax = style.axes_or_new(ax, 8.6, 5.0, aside=1.6)
    ax.set_xscale("log")
    ax.set_yscale("log")
    for k, way in enumerate(ways):
        own = (row for row in rows if row["way"] == way and row["outcome"] == "ok")
        mine = [(_error(row, axis), row[cost]) for row in own if _error(row, axis) and row[cost]]
        look: dict[str, Any] = {"marker": style.marker_of(k), "color": style.colour_of(k)}
        look["linestyle"] = "-" if k < len(style.COLOURS) else "--"
        points = np.array(mine, dtype=float).reshape(-1, 2)
        ax.plot(*points.T, markersize=4, linewidth=1.0, label=way, **look)
    if floor is not None and floor > 0.0:
        ax.set_xlim(left=min(ax.get_xlim()[0], 0.3 * floor))
        ax.axvspan(ax.get_xlim()[0], floor, color="#F3F3F3", zorder=0)
        look = {"color": style.GROUND_COLOUR, "linestyle": ":"}
        ax.axvline(floor, label="the references' disagreement", **look)
    concerned = (row for row in rows if axis in row["errors"] or not row["errors"])
    if failed := [row for row in concerned if row["outcome"] != "ok"]:
        _draw_failures(ax, failed, cost, ways)
    style.dress(ax, "", f"error of {axis.replace('_', ' ')} (relative)", COSTS[cost])
    if new:
        style.legend_right(ax)
    return style.figure_of(ax)


def _draw_failures(
    ax: Axes, failed: Sequence[Mapping[str, Any]], cost: str, ways: Sequence[str]
) -> None:
    """Crosses in the band at the right."""
    low, high = np.log10(ax.get_xlim())
    # The band lies beyond the axis as it was, whose upper end is its left edge.
    edge, right = 10.0**high, 10.0 ** (high + _BAND * (high - low) / (1.0 - _BAND))
    ax.axvspan(edge, right, color=style.SHADE_COLOUR, zorder=0)
    ax.set_xlim(10.0**low, right)
    bottom = ax.get_ylim()[0]
    places = np.geomspace(edge, right, len(failed) + 2)[1:-1]
    for place, row in zip(places, failed, strict=True):
        known, height = row["way"] in ways, row[cost] or bottom
        colour = style.colour_of(ways.index(row["way"])) if known else style.GROUND_COLOUR
        ax.plot([place], [height], "x", color=colour, markersize=5)
    words: dict[str, Any] = {"ha": "center", "fontsize": "small"}
    ax.text(1.0 - 0.5 * _BAND, 1.01, "failed", transform=ax.transAxes, **words)


def _error(row: Mapping[str, Any], axis: str) -> float | None:
    found = row["errors"].get(axis)
    return None if found is None else float(found)


_MEASURES = {
    "max_violation_m": r"largest violation, $|\Phi|$ (m)",
    "state_error": "error at the end (SI units)",
    "wall_s_run": "time of a run (s)",
}
_FLOOR = 1e-17
"""Violations below this, zero among them, are drawn here."""


def constraint_runs(runs: Sequence[Mapping[str, Any]]) -> Figure:
    """Draws the violation, the final error and the time of each constraint method and integrator.

    There is a row for each method, a panel on a logarithmic scale for each measure, and a mark for
    each integrator at its tolerance or step size. A failed run is a cross at the right edge of the
    panels of violation and error.

    Args:
        runs: runs as `jaxbiped constraints --json` writes them: `method`, `integrator`, its `rtol`
            or `dt_s` (the other is None), `ending`, `max_violation_m`, `state_error`, `wall_s_run`.

    Returns:
        A new figure.

    Raises:
        ArgumentError: there are no runs.
    """
    if not runs:
        raise ArgumentError("runs is empty: there must be one at least.")
    methods = list(dict.fromkeys(run["method"] for run in runs))
    ways = list(dict.fromkeys(_integrator_label(run) for run in runs))
    columns = style.panels_abreast(len(_MEASURES), width=2.6)
    rows = -(-len(_MEASURES) // columns)
    height = (1.7 + 0.42 * len(methods)) * rows + 0.2 * -(-len(ways) // 3)
    figure = style.new_figure(11.0, height, rows=True)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).flat
    for ax, (measure, label) in zip(panels, _MEASURES.items(), strict=True):
        for k, way in enumerate(ways):
            mine = [run for run in runs if _integrator_label(run) == way]
            places = np.array([methods.index(run["method"]) for run in mine], dtype=float)
            places += 0.5 * (k + 0.5) / len(ways) - 0.25
            _draw_way(ax, mine, places, measure, k, way)
        ax.set_xscale("log")
        ax.margins(x=0.12)
        low, high = ax.get_xlim()
        if high < 100.0 * low:  # with two powers of ten at least, which alone are named
            ax.set_xlim(low / 3.0, max(3.0 * high, 100.0 * low))
        ax.xaxis.set_minor_formatter(NullFormatter())
        style.dress(ax, "", label, "")
    panels[0].set_yticks(np.arange(len(methods)), methods)
    panels[0].set_ylim(len(methods) - 0.5, -0.5)
    for ax in panels[::columns]:
        ax.set_ylabel("method")
    handles, _ = panels[0].get_legend_handles_labels()
    if any(_has_failed(run) for run in runs):
        handles += panels[0].plot([], [], "x", color=style.GROUND_COLOUR, label="failed")
    style.legend_of_figure(figure, handles)
    return figure


def _draw_way(
    ax: Axes, runs: list[Mapping[str, Any]], rows: np.ndarray, measure: str, k: int, way: str
) -> None:
    """One integrator's marks in one panel."""
    values = np.array([run[measure] for run in runs], dtype=float)
    failed = np.array([_has_failed(run) for run in runs])
    # A run that failed took its time all the same.
    lost = failed & (measure != "wall_s_run") | ~np.isfinite(values)
    found, colour = np.maximum(values[~lost], _FLOOR), style.colour_of(k)
    ax.plot(found, rows[~lost], style.marker_of(k), color=colour, markersize=6, label=way)
    edge = ax.get_yaxis_transform()
    ax.plot(np.full(lost.sum(), 0.985), rows[lost], "x", color=colour, transform=edge)


def _integrator_label(run: Mapping[str, Any]) -> str:
    step = run["dt_s"]
    by = f"tolerance {run['rtol']:g}" if step is None else f"steps of {step:g} s"
    return f"{run['integrator']}, {by}"


def _has_failed(run: Mapping[str, Any]) -> bool:
    return bool(run["ending"] != "walking")
