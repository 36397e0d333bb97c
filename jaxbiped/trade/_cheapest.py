"""Cost at an equal error, and the setting that has it cheapest."""

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from jaxbiped.trade._row import OK, Row

Cost = Callable[[Row], float | None]


def cheapest(rows: Iterable[Row], axis: str, error: float, cost: Cost) -> Row | None:
    """The cheapest row among those that reach an error; None where none does.

    Args:
        rows: of any ways.
        axis: name of the error axis.
        error: largest error allowed, in that axis's units.
        cost: of a row; None where it is not known.
    """
    good = [row for row in rows if _reaches(row, axis, error) and cost(row) is not None]
    return min(good, key=lambda row: _known(cost(row)), default=None)


def cost_at(rows: Sequence[Row], axis: str, error: float, cost: Cost) -> float | None:
    """Cost of one way at an error, between its settings along straight lines of the logarithms.

    Compared ways must be compared so: at one tolerance they have different errors.

    Args:
        rows: of one way, from its loosest setting to its finest.
        axis: name of the error axis.
        error: that every compared way is to have, in that axis's units.
        cost: of a row; None where it is not known.

    Returns:
        The least cost at which the way passes that error, None where it never does. A way whose
        loosest setting has a smaller error costs what that costs.
    """
    points = [
        (np.log(_known(row.errors[axis])), np.log(_known(cost(row))))
        for row in rows
        if _reaches(row, axis, np.inf) and cost(row) is not None
    ]
    if not points:
        return None
    aim = np.log(error)
    found = [points[0][1]] if points[0][0] <= aim else []
    for (e0, c0), (e1, c1) in itertools.pairwise(points):
        if e1 <= aim < e0:
            found.append(c0 + (c1 - c0) * (e0 - aim) / (e0 - e1))
    return float(np.exp(min(found))) if found else None


def _reaches(row: Row, axis: str, error: float) -> bool:
    reached = row.errors.get(axis)
    return row.outcome == OK and reached is not None and 0.0 < reached <= error


def _known(value: Any) -> float:
    return float(value)
