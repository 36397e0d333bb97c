"""Constraint methods compared: violation, error and time."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped._checks import ArgumentError
from jaxbiped.plot._style import GROUND_COLOUR, dress, new_figure
from jaxbiped.simulate._compare_constraints import ConstraintRun

_MEASURES: dict[str, Callable[[ConstraintRun], float]] = {
    r"largest violation, $|\Phi|$ (m)": lambda run: run.max_violation_m,
    "error of the state at the end (SI units)": lambda run: run.state_error,
    "time of a run (s)": lambda run: run.wall_s_run,
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_MARKERS = "osD^vPX"
_FLOOR = 1e-17
"""Violations below this, zero among them, are drawn here."""


def constraint_runs(runs: Sequence[ConstraintRun]) -> Figure:
    """Draws what each method × integrator violates, how far off it ends and how long it takes.

    A row for each method, a panel for each measure on a logarithmic scale, a mark for each
    integrator at its tolerance or step size. A run that failed stands as a cross at the right
    edge of the panels of violation and error.

    Args:
        runs: what `jaxbiped.compare_constraints` found.

    Returns:
        A new figure.

    Raises:
        ArgumentError: no runs.
    """
    if not runs:
        raise ArgumentError("runs is empty: there must be one at least.")
    methods = list(dict.fromkeys(run.method for run in runs))
    ways = list(dict.fromkeys(_integrator_label(run) for run in runs))
    figure = new_figure(11.0, 1.7 + 0.42 * len(methods) + 0.2 * -(-len(ways) // 3))
    panels = figure.subplots(1, len(_MEASURES), sharey=True)
    for ax, (label, measure) in zip(panels, _MEASURES.items(), strict=True):
        timed = label == list(_MEASURES)[-1]
        for k, way in enumerate(ways):
            mine = [run for run in runs if _integrator_label(run) == way]
            rows = np.array([methods.index(run.method) for run in mine], dtype=float)
            rows += 0.5 * (k + 0.5) / len(ways) - 0.25
            _draw_way(ax, mine, rows, measure, k, way, timed)
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
    runs: list[ConstraintRun],
    rows: np.ndarray,
    measure: Callable[[ConstraintRun], float],
    k: int,
    way: str,
    timed: bool,
) -> None:
    """One integrator's marks in one panel."""
    values = np.array([measure(run) for run in runs])
    lost = np.array([_failed(run) for run in runs]) & (not timed) | ~np.isfinite(values)
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


def _integrator_label(run: ConstraintRun) -> str:
    return f"{run.integrator}, " + (
        f"steps of {run.rtol_or_dt:g} s" if run.fixed else f"tolerance {run.rtol_or_dt:g}"
    )


def _failed(run: ConstraintRun) -> bool:
    return run.ending != "walking"
