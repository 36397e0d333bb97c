"""Ends of profile intervals.

The end of an interval is where the least sum of squares that the other parameters can reach has
grown by a given amount (Venzon and Moolgavkar 1988). For a linear model that is a multiple of the
standard error of the joint fit; where the model bends, it is followed there by steps that are
exact for a quadratic sum of squares, and shortened until an exact penalty improves (Fukushima, Luo
and Tseng 2003).
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
AT_LIMIT = 1e-9
"""Distance of a variable from its limit that counts as none."""

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
        The end, infinite where none is found, as where the sum of squares is less at the limit.
    """
    here, near = at, np.clip(limits, at - _FAR, at + _FAR)
    bend = np.zeros((len(at), len(at)))
    for _ in range(_MOST):
        room = np.clip(near - here, -_REACH, _REACH)
        step, flat, worth = linear_step(*_bent(known, bend, square), which, sign, room)
        ahead, excess = here[which] + step[which], _excess(known, square)
        farthest = abs(here[which] - at[which])
        if _FAR * flat > _SHARE * max(farthest, abs(step[which])):
            break  # it moves as far where the sum of squares does not change
        if np.any(np.abs(here + step - at) >= _FAR):
            break  # the others might make up for even more
        if abs(step[which]) <= _SHARE * farthest and excess <= 1.96**2 * _SHARE:
            return float(ahead)
        for _ in range(_HALVINGS):
            there = model(here + step)
            if there is not None:
                is_limit = np.isclose(here + step, limits, rtol=0.0, atol=AT_LIMIT)[:, which].any()
                if is_limit and _excess(there, square) == 0.0:
                    return sign * np.inf
                bend = _secant(bend, step, known, there)
                gain = sign * step[which] * worth + excess - _excess(there, square)
                if gain > 0.0:
                    break
            step = 0.5 * step
        else:  # no gait on the way: there may be some beyond
            break
        here, known = here + step, there
    return sign * np.inf


def _bent(
    known: tuple[np.ndarray, np.ndarray], bend: np.ndarray, square: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Residuals, derivatives and an end with the same sum of squares and gradient as those known,
    and with this bend added to its second derivatives; those known where it has no minimum then.
    """
    residuals, slopes = known
    values, vectors = np.linalg.eigh(slopes.T @ slopes + bend)
    if not bend.any() or min(values[0], np.linalg.norm(slopes, -2) ** 2) <= _FLAT**2:
        return residuals, slopes, square
    roots = np.sqrt(values)
    own = (vectors / roots).T @ (slopes.T @ residuals)
    return own, roots[:, None] * vectors.T, square - float(residuals @ residuals - own @ own)


def _secant(
    bend: np.ndarray,
    step: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
    there: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Σ rᵢ ∇²rᵢ, updated by a symmetric correction of rank one (Dennis, Gay and Welsch 1981)."""
    off = (there[1] - known[1]).T @ there[0] - bend @ step
    along = float(off @ step)
    small = abs(along) <= 1e-8 * float(np.linalg.norm(off) * np.linalg.norm(step))
    return bend if small else bend + np.outer(off, off) / along


def _excess(known: tuple[np.ndarray, np.ndarray], square: float) -> float:
    """By how much the sum of squares exceeds `square`."""
    return max(float(np.sum(known[0] ** 2)) - square, 0.0)


def linear_step(
    residuals: np.ndarray,
    slopes: np.ndarray,
    square: float,
    which: int,
    sign: float,
    room: np.ndarray,
) -> tuple[np.ndarray, float, float]:
    """The step to that end by the linearised model, shape (k,); how much of the variable lies along
    directions in which nothing is moved, from 0 to 1; and half the rate of the least sum of squares
    with the variable there, 0 where the model does not come down to `square`.

    A variable that would leave its room (2, k) stops there, and the others make up for that.
    """
    step, free, worth = np.zeros(slopes.shape[1]), np.ones(slopes.shape[1], bool), 0.0
    while True:
        part = slopes[:, free]
        largest = np.linalg.norm(part, 2) if part.size else 0.0
        inverse = np.linalg.pinv(part, rcond=min(_FLAT / max(largest, _FLAT), 1.0))
        held = residuals + slopes[:, ~free] @ step[~free]
        step[free], flat = -inverse @ held, 0.0
        if free[which]:
            spare = square - float(np.sum((held + slopes[:, free] @ step[free]) ** 2))
            place = np.count_nonzero(free[:which])
            row, (_, singular, rows) = inverse[place], np.linalg.svd(part)
            flat = float(np.linalg.norm(rows[np.sum(singular > _FLAT) :, place]))
            if spare > 0.0 and row.any():
                worth = np.sqrt(spare) / np.linalg.norm(row)
                step[free] += sign * worth * (inverse @ row)
        beyond = free & ((step < room[0]) | (step > room[1]))
        if not beyond.any():
            return step, flat, worth
        step = np.where(beyond, np.clip(step, *room), step)
        free &= ~beyond
