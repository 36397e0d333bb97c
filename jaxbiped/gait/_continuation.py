"""Continuation of the seed's gait to another scene, along a line in the parameters.

A search that fails from its start comes by it to scenes far from the seed's.
"""

import enum
from collections.abc import Callable
from itertools import islice
from typing import NamedTuple

import numpy as np

from jaxbiped.gait._pseudo_arclength import (
    Change,
    Curve,
    CurvePoint,
    StepControl,
    correct,
    follow,
    locate,
)

_CONTROL = StepControl(first=0.08, largest=0.35, smallest=2e-4)
_CONVERGED = 2e-5
"""Size of a correction that ends the corrector."""
_AT_END = 1e-9
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
    - no walk: beyond, the orbit is none of a walk (see `Search`).
    - closed: it came back to its beginning.
    - branches off: it begins at another branch.
    - jumped: a step led back to gaits that it had passed.
    """

    NOT_FOLLOWED = 0
    REACHED = 1
    FOLD = 2
    WALK_ENDS = 3
    BREAKS_OFF = 4
    NO_BEGINNING = 5
    UNFINISHED = 6
    NO_WALK = 7
    CLOSED = 8
    BRANCHES_OFF = 9
    JUMPED = 10

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


class FollowedBranch(NamedTuple):
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
    smallest: float = _CONTROL.smallest,
    most_steps: int = 150,
) -> FollowedBranch:
    """Follows the branch of zeros of `change` from one at s = 0 until s = 1.

    Args:
        change: of a point, shape (m,), and s.
        start: the zero at s = 0.
        scales: sizes of the components, shape (m,), in which arclength is measured; s in its own.
        smallest: arclength of a step below which the branch is given up.
        most_steps: steps allowed.
    """
    curve = Curve(change, np.append(scales, 1.0), _CONVERGED)
    here = np.append(start, 0.0) / curve.sizes
    first = correct(curve, here, np.eye(len(here))[-1])
    if first.found is None:
        return FollowedBranch(start[None], np.zeros(1), BranchEnd.NO_BEGINNING, first.code)
    control = _CONTROL._replace(smallest=smallest)
    path, end, code = [first.found], BranchEnd.UNFINISHED, 0
    for attempt in islice(follow(curve, first.found, control, high=1.0), most_steps):
        if attempt.found is None:
            code = attempt.code
            end = BranchEnd.WALK_ENDS if code else BranchEnd.BREAKS_OFF
            break
        here, there = path[-1], attempt.found
        if here.place[-1] < 1.0 < there.place[-1]:  # a step about a bend
            there = _at_end(curve, here, there) or there
        path += [*_fold(curve, here, there), there]
        if abs(there.place[-1] - 1.0) < _AT_END:
            end = BranchEnd.REACHED
        if end is BranchEnd.REACHED or _is_far_behind_a_fold(path):
            break
    if end is not BranchEnd.REACHED and any(point.tangent[-1] < 0.0 for point in path):
        end, code = BranchEnd.FOLD, 0
    points = np.stack([point.place for point in path]) * curve.sizes
    return FollowedBranch(points[:, :-1], points[:, -1], end, code)


def _at_end(curve: Curve, here: CurvePoint, there: CurvePoint) -> CurvePoint | None:
    """The point at s = 1 between two points on either side of it."""
    share = (1.0 - here.place[-1]) / (there.place[-1] - here.place[-1])
    guess = here.place + share * (there.place - here.place)
    return correct(curve, guess, np.eye(len(guess))[-1], here.tangent).found


def _fold(curve: Curve, here: CurvePoint, there: CurvePoint) -> list[CurvePoint]:
    """The fold between two points; none where there is none, or it is not found."""
    if here.tangent[-1] * there.tangent[-1] >= 0.0:
        return []
    found = locate(curve, here, there, lambda point: float(point.tangent[-1]))
    return [] if found is None else [found]


def _is_far_behind_a_fold(path: list[CurvePoint]) -> bool:
    """Whether a branch that turned back was followed back for long enough."""
    behind = [k for k, point in enumerate(path) if point.tangent[-1] < 0.0]
    if not behind:
        return False
    back = max(point.place[-1] for point in path) - path[-1].place[-1]
    return len(path) - behind[0] > _BEYOND_FOLD or back > _BACK
