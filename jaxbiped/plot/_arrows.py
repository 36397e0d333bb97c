"""Arrows along a curve, in the direction in which it is run through."""

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

_PLACES = (0.12, 0.37, 0.62, 0.87)
"""Of the arrows, in parts of the curve's length."""


def direction_arrows(ax: Axes, x: npt.ArrayLike, y: npt.ArrayLike, colour: str) -> None:
    """Puts arrow heads along a curve, evenly over its length as it is seen."""
    points = np.stack([np.asarray(x, dtype=float), np.asarray(y, dtype=float)], axis=-1)
    spans = np.ptp(points, axis=0)
    if len(points) < 2 or not (spans > 0.0).all():
        return
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*(np.diff(points, axis=0) / spans).T))])
    for place in _PLACES:
        ends = np.array([place - 0.004, place + 0.004]) * along[-1]
        tail, head = (tuple(np.interp(end, along, part) for part in points.T) for end in ends)
        ax.annotate(
            "",
            head,
            tail,
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "linewidth": 0.0,
                "mutation_scale": 15.0,
                "shrinkA": 0.0,
                "shrinkB": 0.0,
            },
        )
