"""Pictures of a trade study."""

from collections.abc import Mapping, Sequence
from typing import Any

from _options import Options

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

PANELS = (
    ("walk", "state", "cpu_s", "State after 2 s"),
    ("walk", "state", "attempted", "State after 2 s, steps"),
    ("walk", "step_time", "cpu_s", "Times of heel strikes"),
    ("walk", "energy", "cpu_s", "Energy ledger"),
    ("batch", "state", "cpu_s", "State, a batch"),
    ("basin", "labels", "cpu_s", "Wrong labels of 4096 starts"),
    ("basin", "walking", "cpu_s", "Starts wrong about walking or not, of 4096"),
    ("slopes", "slopes", "cpu_s", "State's slopes by K, c, ξ"),
    ("gait", "period", "cpu_s", "Gait's period"),
    ("gait", "multiplier", "cpu_s", "Largest multiplier"),
    ("gait", "gradient", "cpu_s", "Period's gradient by K, c, ξ"),
    ("stepping", "gradient", "attempted", "Period's gradient by K, by stepping"),
    ("smoothed laws", "state", "attempted", "State after 2 s, smoothed laws"),
    ("v0 ten times wider", "state", "attempted", "State after 2 s, v0 ten times wider"),
    ("rigid gait", "multiplier", "cpu_s", "Largest multiplier, rigid walker"),
)
"""Group, error axis, cost and title of each panel."""
COLUMNS = 2


def draw(
    options: Options, rows: Mapping[str, Sequence[Any]], floors: Mapping[str, dict[str, float]]
) -> str:
    """Draws the panels of the groups that have rows; returns the picture's path."""
    shown = [panel for panel in PANELS if _has_errors(rows.get(panel[0], ()), panel[1])]
    lines = -(-len(shown) // COLUMNS)
    figure = new_figure(15.0, 4.4 * lines)
    axes = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    for ax, (group, axis, cost, title) in zip(axes, shown, strict=False):
        told = [row.numbers() for row in rows[group]]
        floor = floors.get(group, {}).get(axis)
        jb.plot.work_precision(told, axis, cost=cost, floor=floor, ax=ax)
        ax.set_title(title, loc="left")
        ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=7, frameon=False)
    for ax in axes[len(shown) :]:
        ax.set_visible(False)
    return options.save(figure, "trade.png")


def _has_errors(rows: Sequence[Any], axis: str) -> bool:
    return any(row.errors.get(axis) for row in rows if row.outcome == "ok")
