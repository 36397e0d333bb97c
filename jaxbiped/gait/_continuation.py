"""Continuation of a fixed point by pseudo-arclength: along a branch, and around its folds.

Seydel, Practical Bifurcation and Stability Analysis (2010), chapter 4.
"""

import enum
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

_FIRST, _LARGEST, _SMALLEST = 0.08, 0.35, 2e-4
"""Arclengths of steps: of the first, at most, and at which a branch is given up."""
_MOST_CORRECTIONS = 6
_CONTRACTION = 0.6
"""Share of a correction that the next may have."""
_CONVERGED = 2e-5
"""Size of a correction that ends the corrector."""
_LEAST_COSINE = 0.85
"""Of the angle between the tangents at the two ends of a step."""
_FOLD_STEPS = 3
"""Secant steps towards a fold."""
_BEYOND_FOLD, _BACK = 24, 0.25
"""Steps, and distance in s, for which a branch is followed back behind its first fold."""


class BranchEnd(enum.IntEnum):
    """How a branch of gaits ended. `str(end)` is its name in words.

    - not followed: there was no need to.
    - reached: it came to the scene that was asked for.
    - fold: it turned back at a fold.
    - walk ends: beyond, the walk of the gait itself ends (its `Ending` tells how).
    - breaks off: the return map is not smooth there, as where a foot begins to scuff.
    - no beginning: no gait is known to begin from.
    - unfinished: the steps allowed were used up.
    """

    NOT_FOLLOWED = 0
    REACHED = 1
    FOLD = 2
    WALK_ENDS = 3
    BREAKS_OFF = 4
    NO_BEGINNING = 5
    UNFINISHED = 6

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class Change(NamedTuple):
    """By how much a map moves a point, and the derivatives of that.

    Attributes:
        value: shape (m,).
        by_point: derivatives with respect to the point, shape (m, m).
        by_s: with respect to the branch's parameter, shape (m,).
        code: 0, or that of the `Ending` that came instead.
    """

    value: np.ndarray
    by_point: np.ndarray
    by_s: np.ndarray
    code: int


class Branch(NamedTuple):
    """A branch of fixed points.

    Attributes:
        points: shape (n, m).
        s: the parameter's values, shape (n,).
        end: how it ended.
        code: of the `Ending` of a walk that did not return, where the branch ended by it.
    """

    points: np.ndarray
    s: np.ndarray
    end: BranchEnd
    code: int = 0

    @property
    def farthest(self) -> int:
        """The point nearest to the scene that was asked for."""
        return int(np.argmax(self.s))


def follow_branch(
    change: Callable[[np.ndarray, float], Change],
    start: np.ndarray,
    *,
    scales: np.ndarray,
    most_steps: int = 150,
) -> Branch:
    """Follows the branch of zeros of `change` from one at s = 0 until s = 1.

    Args:
        change: of a point, shape (m,), and s.
        start: the zero at s = 0.
        scales: sizes of the components, shape (m,), in which arclength is measured; s in its own.
        most_steps: steps allowed.
    """
    sizes = np.append(scales, 1.0)
    change_here = change(start, 0.0)
    if change_here.code != 0:
        return Branch(start[None], np.zeros(1), BranchEnd.NO_BEGINNING, change_here.code)
    here, tangent = np.append(start, 0.0) / sizes, _tangent(change_here, sizes, None)
    path, step, code, since_fold, folded = [here], _FIRST, 0, 0, False
    for _ in range(most_steps):
        length = step
        if tangent[-1] > 0.0 and here[-1] + length * tangent[-1] > 1.0:
            length = (1.0 - here[-1]) / tangent[-1]
        # The last step ends on s = 1, the others where the tangent says.
        border = np.eye(len(here))[-1] if length < step else tangent
        found, quick, failure = _correct(change, here + length * tangent, border, sizes)
        if found is not None:
            there, change_here = found
            ahead = _tangent(change_here, sizes, tangent)
            if ahead @ tangent < _LEAST_COSINE and step > 50.0 * _SMALLEST:
                found = None
        if found is None:
            code = failure
            step *= 0.4
            if step < _SMALLEST:
                break
            continue
        if tangent[-1] * ahead[-1] < 0.0:
            path += _fold(change, here, (tangent, ahead), length, sizes)
        folded = folded or ahead[-1] < 0.0
        here, tangent = there, ahead
        path.append(here)
        if length < step:
            return _branch(path, sizes, BranchEnd.REACHED)
        if folded:
            since_fold += 1
            back = max(point[-1] for point in path) - here[-1]
            if since_fold > _BEYOND_FOLD or back > _BACK:
                return _branch(path, sizes, BranchEnd.FOLD)
        step = min(_LARGEST, step * (1.7 if quick else 1.1))
    else:
        return _branch(path, sizes, BranchEnd.FOLD if folded else BranchEnd.UNFINISHED)
    if folded:
        return _branch(path, sizes, BranchEnd.FOLD)
    return _branch(path, sizes, BranchEnd.WALK_ENDS if code else BranchEnd.BREAKS_OFF, code)


def _fold(
    change: Callable[[np.ndarray, float], Change],
    here: np.ndarray,
    tangents: tuple[np.ndarray, np.ndarray],
    length: float,
    sizes: np.ndarray,
) -> list[np.ndarray]:
    """The zero at the fold between two others, by the secant rule; none where it is not found."""
    lengths, rises, points = [0.0, length], [tangents[0][-1], tangents[1][-1]], []
    for _ in range(_FOLD_STEPS):
        (a, b), (u, v) = lengths[-2:], rises[-2:]
        lengths.append(a - u * (b - a) / (v - u))
        guess = here + lengths[-1] * tangents[0]
        found, *_ = _correct(change, guess, tangents[0], sizes)
        if found is None:
            return []
        point, change_here = found
        points.append(point)
        rises.append(_tangent(change_here, sizes, tangents[0])[-1])
    return points[-1:]


def _branch(path: list[np.ndarray], sizes: np.ndarray, end: BranchEnd, code: int = 0) -> Branch:
    points = np.stack(path) * sizes
    return Branch(points[:, :-1], points[:, -1], end, code)


def _correct(
    change: Callable[[np.ndarray, float], Change],
    guess: np.ndarray,
    border: np.ndarray,
    sizes: np.ndarray,
) -> tuple[tuple[np.ndarray, Change] | None, bool, int]:
    """The zero near `guess` in the plane normal to `border`, whether it came quickly, and if none
    did the code of the walk that did not return."""
    point, last = guess, np.inf
    for k in range(_MOST_CORRECTIONS):
        change_here = change(point[:-1] * sizes[:-1], float(point[-1]))
        if change_here.code != 0:
            return None, False, change_here.code
        matrix = np.vstack([_slopes(change_here, sizes), border])
        right = np.append(-change_here.value / sizes[:-1], 0.0)
        try:
            move = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            return None, False, 0
        size = float(np.linalg.norm(move))
        if not size <= max(_CONTRACTION * last, _CONVERGED):
            return None, False, 0
        if size <= _CONVERGED:
            return (point + move, change_here), k <= 2, 0
        point, last = point + move, size
    return None, False, 0


def _slopes(change_here: Change, sizes: np.ndarray) -> np.ndarray:
    """Derivatives of the scaled change with respect to the scaled point and s, (m, m + 1)."""
    both = np.column_stack([change_here.by_point, change_here.by_s])
    return both * sizes / sizes[:-1, None]


def _tangent(change_here: Change, sizes: np.ndarray, before: np.ndarray | None) -> np.ndarray:
    """Unit tangent of the branch, on from `before`, or towards larger s."""
    *_, rows = np.linalg.svd(_slopes(change_here, sizes))
    forward = rows[-1][-1] if before is None else rows[-1] @ before
    return rows[-1] if forward >= 0.0 else -rows[-1]
