"""Derivatives of a gait of the compliant walker: multipliers and elasticities of its period.

By central differences of the flow over one period from a state of the gait, with two sizes of
differences. No section is needed: the flow's own direction has the multiplier 1.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from .compliant import derivative
from .scipy_solves import scales, states_of

_EXCHANGED = [0, 1, 3, 2, 4, 5, 7, 6]
_FINE = 1e-12
_CHANGE = 1e-5
"""Relative change of a parameter."""
_THIRD = 1.0 / 3.0


class CheckedGait(NamedTuple):
    """What the check knows of a gait's derivatives.

    Attributes:
        residual: change of the state over the period but for x, in units of the walker [–].
        multipliers: complex, shape (7,), the flow's own 1 among them.
        elasticities: d log period / d log parameter, shape (k,).
        doubt_multipliers, doubt_elasticities: their changes by a third of the differences.
    """

    residual: float
    multipliers: np.ndarray
    elasticities: np.ndarray
    doubt_multipliers: float
    doubt_elasticities: float


def checked_gait(
    start: np.ndarray, period: float, p: np.ndarray, varied: tuple[int, ...]
) -> CheckedGait | None:
    """Derivatives of the gait from a state of it; None where a solve fails.

    Args:
        start: a state of the gait, shape (8,), SI units.
        period: of one footstep, after which the legs have changed places [s].
        p: numbers of the scene, see `compliant`.
        varied: places in p of the parameters.
    """
    units = scales(p, 8)

    def flow(y: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        return states_of(y, numbers, period, _FINE, points=40)[-1][_EXCHANGED]

    end = flow(start, p)
    found = [_linearised(start, end, p, varied, flow, share, period) for share in (1.0, _THIRD)]
    if not all(np.all(np.isfinite(each)) for pair in found for each in pair):
        return None
    (multipliers, elasticities), (others, less) = found
    residual = np.max(np.abs(end - start)[1:] / units[1:])
    return CheckedGait(
        float(residual),
        multipliers,
        elasticities,
        apart(multipliers, others),
        float(np.max(np.abs(elasticities - less))),
    )


def _linearised(
    start: np.ndarray,
    end: np.ndarray,
    p: np.ndarray,
    varied: tuple[int, ...],
    flow: Callable[[np.ndarray, np.ndarray], np.ndarray],
    share: float,
    period: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers and elasticities by differences of that share of their full size."""
    slow = p[18]
    depth = max(p[4] - start[1] + (p[2] - p[4]) * np.cos(start[2:4]).max(), 1e-9)
    place, speed = min(1e-6, 3e-3 * depth), min(1e-6, 0.1 * slow)
    steps = share * np.array([place] * 4 + [speed] * 4)
    columns = []
    for k in range(1, 8):
        change = np.eye(8)[k] * steps[k]
        columns.append((flow(start + change, p) - flow(start - change, p))[1:] / (2.0 * steps[k]))
    moved = np.stack(columns, axis=1)
    if not np.all(np.isfinite(moved)):
        return np.full(7, np.nan), np.full(len(varied), np.nan)
    rates = derivative(0.0, end[_EXCHANGED], p)[_EXCHANGED]
    # Unknown are the change of the state, with θ2 held, and that of the period.
    matrix = np.zeros((8, 8))
    matrix[:7, :7] = moved - np.eye(7)
    matrix[:7, 7] = rates[1:]
    matrix[7, 2] = 1.0
    elasticities = []
    for at in varied:
        up, down = p.copy(), p.copy()
        up[at] *= np.exp(share * _CHANGE)
        down[at] *= np.exp(-share * _CHANGE)
        change = (flow(start, up) - flow(start, down))[1:] / (2.0 * share * _CHANGE)
        solved = np.linalg.lstsq(matrix, np.append(-change, 0.0), rcond=None)[0]
        elasticities.append(solved[7] / period)
    return np.linalg.eigvals(moved), np.array(elasticities)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """The largest distance of multipliers that belong together, in units of the largest or 1."""
    if not (np.all(np.isfinite(one)) and np.all(np.isfinite(other))):
        return np.inf
    distances = np.abs(one[:, None] - other[None, :])
    rows, columns = linear_sum_assignment(distances)
    return float(np.max(distances[rows, columns]) / max(1.0, np.max(np.abs(one))))
