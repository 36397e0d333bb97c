"""Profile intervals: how far a parameter may lie while all others make up for it.

The end of an interval is where the least sum of squares that the other parameters can reach has
grown by a given amount (Venzon and Moolgavkar 1988). For a linear model that is a multiple of the
standard error of the joint fit; where the model bends, it is followed there.
"""

from collections.abc import Callable

import numpy as np

_MOST = 15
"""Scenes that are tried for one end, at most."""
_SHARE = 0.02
"""Part of an interval's half-width by which its end may still move."""
_REACH = 1.0
"""Largest change of any variable in one step."""
_HALVINGS = 4
_FLAT = 0.05
"""Singular value of the derivatives, in standard deviations, below which nothing is moved: three
units along its direction change the sum of squares by 0.02."""
_FAR = 3.0
"""How far from the fit a variable is followed: a factor of 20."""

Model = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray] | None]
"""Residuals (n,) and their derivatives (n, k) at variables; None where there are none."""


def interval_end(
    model: Model,
    at: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
    square: float,
    which: int,
    sign: float,
    limits: np.ndarray,
) -> float:
    """The farthest value of a variable for which the sum of squares need not exceed `square`.

    Args:
        model: the fit.
        at, known: where the fit ended, shape (k,), and the model there.
        square: sum of squares at the end.
        which: the variable.
        sign: 1 for the upper end, −1 for the lower.
        limits: of all variables, shape (2, k).

    Returns:
        The end, infinite where none is found.
    """
    here, farthest = at, 0.0
    near = np.clip(limits, at - _FAR, at + _FAR)
    for _ in range(_MOST):
        room = np.clip(near - here, -_REACH, _REACH)
        step = linear_step(*known, square, which, sign, room)
        ahead = here[which] + step[which]
        if np.any(np.abs(here + step - at) >= _FAR):
            break  # the others might make up for even more
        if ahead in limits[:, which] or abs(step[which]) <= _SHARE * farthest:
            return float(ahead)
        for _ in range(_HALVINGS):
            there = model(here + step)
            if there is not None:
                known = there
                break
            step = 0.5 * step
        else:  # the gait, or the walker, ends before the interval does
            return float(ahead)
        here = here + step
        farthest = max(farthest, abs(here[which] - at[which]))
    return sign * np.inf


def linear_step(
    residuals: np.ndarray,
    slopes: np.ndarray,
    square: float,
    which: int,
    sign: float,
    room: np.ndarray,
) -> np.ndarray:
    """The step to that end by the linearised model, shape (k,).

    A variable that would leave its room (2, k) stops there, and the others make up for that.
    """
    step, free = np.zeros(slopes.shape[1]), np.ones(slopes.shape[1], bool)
    while True:
        part = slopes[:, free]
        largest = np.linalg.norm(part, 2) if part.size else 0.0
        inverse = np.linalg.pinv(part, rcond=min(_FLAT / max(largest, _FLAT), 1.0))
        held = residuals + slopes[:, ~free] @ step[~free]
        step[free] = -inverse @ held
        if free[which]:
            spare = square - float(np.sum((held + slopes[:, free] @ step[free]) ** 2))
            row = inverse[np.count_nonzero(free[:which])]
            if spare > 0.0 and row.any():
                step[free] += sign * np.sqrt(spare) / np.linalg.norm(row) * (inverse @ row)
        beyond = free & ((step < room[0]) | (step > room[1]))
        if not beyond.any():
            return step
        step = np.where(beyond, np.clip(step, *room), step)
        free &= ~beyond
