"""Branch of gaits along a homotopy, from its first scene towards the one asked for."""

from collections.abc import Callable, Iterator
from itertools import chain, islice
from typing import Any, NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar, as_float
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._state import state_of_recurring
from jaxbiped.gait._fixed_point_search import ROUGH, FixedPointProblem, Found, Search
from jaxbiped.gait._homotopy import Homotopy, line_from_model
from jaxbiped.gait._poincare_map import linearised_return, seed_directions, state_with
from jaxbiped.gait._pseudo_arclength import (
    Change,
    Curve,
    CurvePoint,
    StepControl,
    correct,
    follow,
    locate,
)
from jaxbiped.gait._relaxation import has_seed_bodies, is_far_from_seed
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.gait._search_provenance import BranchEnd
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.gait._walk_waves import walks_of
from jaxbiped.hybrid._scales import recurring_sizes
from jaxbiped.scene._parameter_access import select_parameters
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.solve._accuracy import Precision

_CONTROL = StepControl(first=0.08, largest=0.35, smallest=2e-4)
_CONVERGED = 2e-5
"""Size of a correction that ends the corrector."""
_MOST_STEPS = 150
_AT_END = 1e-9
_BEYOND_FOLD, _BACK = 24, 0.25
"""Steps, and distance in s, for which a branch is followed back behind its first fold."""
TURNS = 20
"""Turns that each further search may take."""
_FINER = Precision(3e-7, 3e-6)
"""How exactly the seed's gait is followed again where it was lost, by finer steps."""
_LEAPS, _GAPS = 4, (0.01, 0.05)
"""Leaps over kinks of a branch at most, and how far each leads in s."""
Searching = Callable[[FixedPointProblem, int], Found]
"""Newton's method on a return map from a guess, in at most so many evaluations."""


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
    def is_lost(self) -> bool:
        """Whether it ended where the return map has a kink, or beyond its last walk."""
        return self.end in (BranchEnd.WALK_ENDS, BranchEnd.BREAKS_OFF)

    @property
    def farthest(self) -> int:
        """The point nearest to the scene that was asked for, before the branch turned back: behind
        its first fold, orbits need not be walks."""
        turned = np.flatnonzero(np.diff(self.s) < 0.0)
        return int(turned[0] if turned.size else np.argmax(self.s))


def state_at(kind: type, point: np.ndarray) -> WalkerState:
    """The state with these components besides hip_x, of numbers that take no time to make."""
    return jtu.tree_map(as_float, state_of_recurring(kind, point.tolist()))


def branch_along(
    line: Homotopy,
    search: Searching,
    problem: FixedPointProblem,
    like: WalkerState,
    *,
    begins_at_model: bool = False,
) -> FollowedBranch:
    """The branch of gaits from a line's first scene.

    Args:
        line: the scenes.
        search: Newton's method, for the first gait and behind kinks of the branch.
        problem: of cycles of one footstep, in minimal coordinates.
        like: a state of the scenes.
        begins_at_model: whether the first scene's legs are a model's; else its gait may be sought
            from there, too.
    """
    begin: Any = line.first
    start = default_guess(begin)
    problem = problem._replace(active=_columns(line) if problem.active else ())
    first = search(problem._replace(args=begin, guess=start), TURNS)
    if int(first.ending) != int(Search.FOUND) and not has_seed_bodies(begin):
        for point in _likely_gaits(begin, begins_at_model, search, problem, like):
            there = state_at(type(start), point)
            first = search(problem._replace(args=begin, guess=there), TURNS)
            if int(first.ending) == int(Search.FOUND):
                break
    point = np.asarray(first.recurring)
    if int(first.ending) != int(Search.FOUND):
        return FollowedBranch(point[None], np.zeros(1), BranchEnd.NO_BEGINNING, int(first.code))

    def followed(
        point: np.ndarray,
        s: float,
        precision: Precision = ROUGH,
        smallest: float = _CONTROL.smallest,
    ) -> FollowedBranch:
        def change(point: np.ndarray, s: float) -> Change:
            given: PyTree = point, np.float64(s), precision
            told = _scene_along(problem.spec, line, like, *given)
            value, by_point, by_s, code = map(np.asarray, told)
            return Change(value, by_point, by_s, int(code))

        scales = recurring_sizes(line.first, like)
        return follow_branch(change, point, s, scales=scales, smallest=smallest)

    branch = followed(point, 0.0)
    if branch.is_lost and not is_far_from_seed(begin):
        # On stiff ground rough solves and long steps may lose the branch before it ends.
        return followed(point, 0.0, _FINER, 0.1 * _CONTROL.smallest)
    for _ in range(_LEAPS):
        beyond = _beyond(search, problem, line, branch) if branch.is_lost else None
        tail = None if beyond is None else followed(*beyond)
        if tail is None or tail.end is BranchEnd.NO_BEGINNING:
            break
        branch = tail
    return branch


def _likely_gaits(
    begin: Any,
    is_model: bool,
    search: Searching,
    problem: FixedPointProblem,
    like: WalkerState,
) -> Iterator[np.ndarray]:
    """Points near which a line's first scene may have its gait: settled walks, a model's branch."""
    for walks in walks_of(begin, list):
        yield from walks.settled()
    from_model = None if is_model else line_from_model(begin)
    if from_model is not None:
        branch = branch_along(from_model, search, problem, like, begins_at_model=True)
        if branch.end is BranchEnd.REACHED:
            yield branch.points[-1]


def _columns(line: Homotopy) -> tuple[int, ...]:
    """Positions of all leaves of a line's scenes, in the order of a gait's sensitivities.

    So a search, what follows it and a step along the line are one program of lanes.
    """
    named = select_parameters(line.last.minimal, None)[1]
    count = len(jtu.tree_leaves(line.last))
    return (*named, *(i for i in range(count) if i not in named))


def _beyond(
    search: Searching, problem: FixedPointProblem, line: Homotopy, branch: FollowedBranch
) -> tuple[np.ndarray, float] | None:
    """A gait and its place a little beyond the one where a branch was lost; None where none is.

    There the return map has a kink, as where a foot begins to scuff: the walker may still walk.
    """
    last = branch.points[branch.farthest]
    for gap in _GAPS:
        s = min(float(branch.s[branch.farthest]) + gap, 1.0)
        scene: Any = line.at(np.float64(s))
        kind = type(default_guess(scene))
        about = walks_of(scene, lambda: [last], most=1)
        settled = (row for walks in about for row in walks.settled())
        for point in chain([last], settled):
            gait = search(problem._replace(args=scene, guess=state_at(kind, point)), TURNS)
            if int(gait.ending) == int(Search.FOUND) and bool(gait.sound):
                return np.asarray(gait.recurring), s
    return None


@host_jit(runs_by_lanes, within=True)
def _scene_along(
    scout: ReturnMapSpec,
    line: Homotopy,
    like: WalkerState,
    point: Scalar,
    s: Scalar,
    precision: Precision,
) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """What a return changes in a point, and how that depends on the point and on s."""
    m, scene, columns = point.shape[0], line.at(s), _columns(line)
    seeds, sizes = seed_directions(scene, columns, m)
    start = state_with(scout.system, like, point)
    once = linearised_return(
        scout, seeds, start, precision, jnp.asarray(False), carries_parameters=jnp.asarray(True)
    )
    by_s = once.jacobian[:, m:] @ (line.slopes(s)[jnp.asarray(columns)] / sizes)
    return once.recurring - point, once.jacobian[:, :m] - jnp.eye(m), by_s, once.code


def follow_branch(
    change: Callable[[np.ndarray, float], Change],
    start: np.ndarray,
    s: float = 0.0,
    *,
    scales: np.ndarray,
    smallest: float = _CONTROL.smallest,
) -> FollowedBranch:
    """Follows the branch of zeros of `change` from one at s until s = 1.

    Args:
        change: of a point, shape (m,), and s.
        start: the zero at s.
        s: where the branch begins.
        scales: sizes of the components, shape (m,), in which arclength is measured; s in its own.
        smallest: arclength of a step below which the branch is given up.
    """
    curve = Curve(change, np.append(scales, 1.0), _CONVERGED)
    here = np.append(start, s) / curve.sizes
    first = correct(curve, here)
    if first.found is None:
        return FollowedBranch(start[None], np.full(1, s), BranchEnd.NO_BEGINNING, first.code)
    control = _CONTROL._replace(smallest=smallest)
    path, end, code = [first.found], BranchEnd.UNFINISHED, 0
    for attempt in islice(follow(curve, first.found, control, high=1.0), _MOST_STEPS):
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
    return correct(curve, guess, here.tangent, holds_s=True).found


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
