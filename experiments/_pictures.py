"""Pictures that experiments draw alike."""

from collections.abc import Iterable, Mapping
from typing import Any

from _experiment import by
from matplotlib.axes import Axes

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")


def draw_by(ax: Axes, key: str, rows: Iterable[Mapping[str, Any]], x: str, y: str) -> None:
    """A line for each value of an entry among rows, named after it: another entry over a third."""
    for name, own in by(key, rows).items():
        ax.plot([row[x] for row in own], [row[y] for row in own], "o-", label=name)


def label(ax: Axes, x: str, y: str, title: str = "", *, log: str = "") -> None:
    """Words of axes, a faint grid, and scales: "x", "y" or "xy" are logarithmic."""
    ax.set(xlabel=x, ylabel=y, title=title)
    ax.grid(alpha=0.3)
    if "x" in log:
        ax.set_xscale("log")
    if "y" in log:
        ax.set_yscale("log")
