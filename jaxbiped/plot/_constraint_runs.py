"""Constraint methods compared: violation, error and time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError
from jaxbiped.plot.style import GROUND_COLOUR, dress, new_figure

_MEASURES = {
    "max_violation_m": r"largest violation, $|\Phi|$ (m)",
    "state_error": "error of the state at the end (SI units)",
    "wall_s_run": "time of a run (s)",
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_MARKERS = "osD^vPX"
_FLOOR = 1e-17
"""Violations below this, zero among them, are drawn here."""


def constraint_runs(runs: Sequence[Mapping[str, Any]]) -> Figure:
    """Draws what each method × integrator violates, how far off it ends and how long it takes.

    A row for each method, a panel for each measure on a logarithmic scale, a mark for each
    integrator at its tolerance or step size. A run that failed stands as a cross at the right
    edge of the panels of violation and error.

    Args:
        runs: as `jaxbiped constraints --json` writes them: `method`, `integrator`, `rtol_or_dt`
            (a step [s] where `fixed`), `ending`, `max_violation_m`, `state_error`, `wall_s_run`.

    Returns:
        A new figure.

    Raises:
        ArgumentError: no runs.
    """
    if not runs:
        raise ArgumentError("runs is empty: there must be one at least.")
    methods = list(dict.fromkeys(run["method"] for run in runs))
    ways = list(dict.fromkeys(_integrator_label(run) for run in runs))
    figure = new_figure(11.0, 1.7 + 0.42 * len(methods) + 0.2 * -(-len(ways) // 3))
    panels = figure.subplots(1, len(_MEASURES), sharey=True)
    for ax, (measure, label) in zip(panels, _MEASURES.items(), strict=True):
        for k, way in enumerate(ways):
            mine = [run for run in runs if _integrator_label(run) == way]
            rows = np.array([methods.index(run["method"]) for run in mine], dtype=float)
            rows += 0.5 * (k + 0.5) / len(ways) - 0.25
            _draw_way(ax, mine, rows, measure, k, way)
        ax.set_xscale("log")
        ax.margins(x=0.12)
        dress(ax, "", label, "")
    panels[0].set_yticks(np.arange(len(methods)), methods)
    panels[0].set_ylim(len(methods) - 0.5, -0.5)
    panels[0].set_ylabel("method")
    handles, labels = panels[0].get_legend_handles_labels()
    if any(_failed(run) for run in runs):
        (cross,) = panels[0].plot([], [], "x", color=GROUND_COLOUR)
        handles, labels = [*handles, cross], [*labels, "failed"]
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw_way(
    ax: Axes,
    runs: list[Mapping[str, Any]],
    rows: np.ndarray,
    measure: str,
    k: int,
    way: str,
) -> None:
    """One integrator's marks in one panel."""
    values = np.array([run[measure] for run in runs], dtype=float)
    failed = np.array([_failed(run) for run in runs])
    # A run that failed took its time all the same.
    lost = failed & (measure != "wall_s_run") | ~np.isfinite(values)
    colour = _COLOURS[k % len(_COLOURS)]
    ax.plot(
        np.maximum(values[~lost], _FLOOR),
        rows[~lost],
        _MARKERS[k % len(_MARKERS)],
        color=colour,
        markersize=6,
        label=way,
    )
    edge = ax.get_yaxis_transform()
    ax.plot(np.full(lost.sum(), 0.985), rows[lost], "x", color=colour, transform=edge)


def _integrator_label(run: Mapping[str, Any]) -> str:
    by = f"{run['rtol_or_dt']:g}"
    return f"{run['integrator']}, " + (f"steps of {by} s" if run["fixed"] else f"tolerance {by}")


def _failed(run: Mapping[str, Any]) -> bool:
    return bool(run["ending"] != "walking")
