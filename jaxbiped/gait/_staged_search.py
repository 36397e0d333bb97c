"""Staged search without a guess: each stage only where those before found no stable gait."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._progress import stage
from jaxbiped._types import Scalar, as_float
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._state import WalkerState
from jaxbiped.dynamics._state_quantities import recurring_leaves, state_of_recurring
from jaxbiped.gait._fixed_point_search import ROUGH, FixedPointProblem, Found, Search, cycle_of
from jaxbiped.gait._homotopy import BranchEnd, FollowedBranch, Homotopy, follow_branch, homotopy_to
from jaxbiped.gait._poincare_map import linearised_return, seed_directions, state_with
from jaxbiped.gait._pseudo_arclength import Change
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.gait._search_provenance import (
    MOST_OTHERS,
    FoundBy,
    Origin,
    OtherGait,
    code_array,
    single_stage_origin,
)
from jaxbiped.gait._search_starts import (
    component_sizes,
    default_guess,
    rolling_starts,
    settle_walks,
)
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.solve._accuracy import Precision

_STARTS = {Scene: (16, 64), RigidScene: (1024,)}
"""Starts from which walks are followed, the more only where the fewer found no stable gait."""
_SPREADS = (0.3, 0.8)
"""Largest relative scatter of the starts' angles and rates, of one half and of the other."""
_PUSHES = (-0.05, -0.01, 0.01, 0.05)
"""Sizes (scaled) of the pushes off an unstable gait from which walks begin as well, and off a
shorter cycle from which longer ones are sought."""
_TURNS = 20
"""Turns that each further search may take."""
_SMALLEST, _FINER = 2e-4, Precision(3e-7, 3e-6)
"""Step at which the seed's gait is lost; how exactly it is then followed again, by finer steps."""
_SCATTERED = 12
"""Starts of the last stage."""
_SAME = 1e-5
"""Relative difference of period and length up to which two finds are of one gait."""


Searching = Callable[[FixedPointProblem, int], Found]
"""Newton's method on a return map from a guess, in at most so many evaluations."""


class Seen(NamedTuple):
    """A gait that a search came to.

    Attributes:
        found: the fixed point.
        by: the stage that came to it.
        radius: its spectral radius.
        is_whole: whether its cycle has all the footsteps that were asked for.
    """

    found: Found
    by: FoundBy
    radius: float
    is_whole: bool = True


class Staged(NamedTuple):
    """What a search in stages came to.

    Attributes:
        best: the stable gait, else the one of smallest spectral radius; one of a shorter cycle only
            where there is no other, None where none was found.
        others: the others that were seen, by their radius.
        branch: the branch from the seed's gait, None where it was not followed.
        line: the scenes along which.
    """

    best: Seen | None
    others: tuple[Seen, ...]
    branch: FollowedBranch | None
    line: Homotopy | None


def search_in_stages(
    search: Searching, problem: FixedPointProblem, scout: ReturnMapSpec, first: Found
) -> Staged:
    """Searches on after Newton's method from the fitted start came to `first`.

    Args:
        search: Newton's method.
        problem: of a walker's cycles.
        scout: how to follow the branch: cycles of one footstep, in minimal coordinates.
        first: what the first stage came to.
    """
    modelled = problem.args.minimal
    seen: list[Seen] = []
    branch = line = None
    start = default_guess(modelled)

    def has_stable() -> bool:
        return any(each.radius < 1.0 and each.is_whole for each in seen)

    def add(found: Found, by: FoundBy) -> None:
        # What a walk itself settles on is one, however deep.
        sound = by is FoundBy.WALKING or bool(found.sound)
        known = any(_same(found, old) for old in seen)
        if int(found.ending) == int(Search.FOUND) and sound and not known:
            seen.append(Seen(found, by, spectral_radius(found), is_whole(found, problem)))

    def try_all(points: Sequence[np.ndarray] | np.ndarray, by: FoundBy) -> None:
        for point in points:
            add(search(problem._replace(guess=_state(start, point)), _TURNS), by)
            if has_stable():
                return

    def walk() -> None:
        for count in _STARTS[type(modelled)] if scout.engine == "lanes" else ():
            if not has_stable():
                with stage(f"walking {count} starts"):
                    points = settle_walks(modelled, _starts(modelled, seen, count))
                try_all(points, FoundBy.WALKING)

    add(first, FoundBy.START)
    if not has_stable():
        walk()
    shorter = [each for each in seen if not each.is_whole]
    if shorter and not has_stable():
        sizes = component_sizes(modelled, start)
        for each in shorter:
            try_all(_push_off(each.found, sizes), FoundBy.SCATTERED_STARTS)
    elif not has_stable():
        with stage("following the seed's gait to this scene"):
            line = homotopy_to(modelled)
            branch = _follow_from_seed(search, problem._replace(spec=scout), line, start)
            if branch.end is BranchEnd.REACHED:
                known = len(seen)
                try_all([branch.points[-1]], FoundBy.CONTINUATION)
                if len(seen) > known and not has_stable():
                    walk()
    if not has_stable():
        with stage(f"searching from {_SCATTERED} scattered starts"):
            scattered = _columns(rolling_starts(modelled, _SCATTERED, spread=0.5, seed=2))
            try_all(scattered[1:], FoundBy.SCATTERED_STARTS)
    ordered = sorted(seen, key=lambda each: (not each.is_whole, each.radius))
    return Staged(ordered[0] if ordered else None, tuple(ordered[1:]), branch, line)


def origin_of(staged: Staged, scene: Scene | RigidScene, start: WalkerState) -> Origin:
    """What a search in stages tells of itself; `scene` in minimal coordinates."""
    by = FoundBy.START if staged.best is None else staged.best.by
    plain = single_stage_origin(scene, start, by)
    columns: PyTree = np.full((MOST_OTHERS, 3 + len(start)), np.nan)
    for row, each in zip(columns, staged.others, strict=False):
        last = each.found.last
        row[:3] = float(last.period), float(last.advance[0]), each.radius
        row[3:] = 0.0, *np.asarray(each.found.recurring).tolist()
    period, length, radius, *state = columns.T
    others = OtherGait(period, length, radius, type(start)(*state))
    if staged.branch is None or staged.line is None:
        return plain._replace(others=others)
    branch = staged.branch
    nearest = plain.nearest
    if branch.end is not BranchEnd.NO_BEGINNING:
        nearest = staged.line.at(np.float64(branch.s[branch.farthest]))
    return plain._replace(
        others=others,
        branch_end=code_array(branch.end),
        branch_walk_ending=code_array(branch.code),
        nearest=nearest,
    )


def is_whole(found: Found, problem: FixedPointProblem) -> bool:
    """Whether a fixed point's cycle has all the footsteps that were asked for."""
    steps = problem.spec.steps
    return steps == 1 or cycle_of(found, float(problem.precision.rtol)) == steps


def spectral_radius(found: Found) -> float:
    """Largest absolute value of a Floquet multiplier: on the section the trivial one is zero."""
    # Not by `last`, which would take every leaf apart.
    jacobian = np.asarray(found.both.jacobian)[0, :, : found.recurring.shape[0]]
    if not np.all(np.isfinite(jacobian)):
        return float("inf")
    return float(np.max(np.abs(np.linalg.eigvals(jacobian))))


def _same(a: Found, b: Seen) -> bool:
    def measures(found: Found) -> np.ndarray:
        last = found.last
        return np.append(np.asarray(last.advance), np.asarray(last.period))

    return bool(np.allclose(measures(a), measures(b.found), rtol=_SAME, atol=0.0))


def _state(like: PyTree, point: np.ndarray) -> WalkerState:
    """The state with these components besides hip_x, of numbers that take no time to make."""
    return jtu.tree_map(as_float, state_of_recurring(type(like), point.tolist()))


def _columns(starts: WalkerState) -> np.ndarray:
    """States without hip_x as rows, shape (n, m)."""
    return np.stack(recurring_leaves(starts), axis=1)


def _starts(scene: Scene | RigidScene, seen: list[Seen], count: int) -> WalkerState:
    """Starts of walks: rolling ones, and states just off the gaits that were seen."""
    halves = [
        rolling_starts(scene, count // 2, spread=spread, seed=k)
        for k, spread in enumerate(_SPREADS)
    ]
    rows = np.concatenate([_columns(half) for half in halves])
    sizes = component_sizes(scene, halves[0])
    pushed = [row for each in seen for row in _push_off(each.found, sizes)][: count // 2]
    if pushed:
        rows[1 : 1 + len(pushed)] = pushed
    return state_of_recurring(type(halves[0]), map(jnp.asarray, rows.T), jnp.zeros(count))


def _push_off(found: Found, sizes: np.ndarray) -> list[np.ndarray]:
    """States just off a gait, along its leading direction."""
    m = len(sizes)
    point = np.asarray(found.recurring)
    values, vectors = np.linalg.eig(np.asarray(found.last.jacobian)[:, :m])
    vector = vectors[:, np.argmax(np.abs(values))].real
    unit = vector / np.linalg.norm(vector / sizes)
    return [point + push * unit for push in _PUSHES]


def _follow_from_seed(
    search: Searching, problem: FixedPointProblem, line: Homotopy, like: WalkerState
) -> FollowedBranch:
    """The branch of gaits from the seed's scene."""
    first = search(problem._replace(args=line.first, guess=default_guess(line.first)), _TURNS)
    point = np.asarray(first.recurring)
    if int(first.ending) != int(Search.FOUND):
        return FollowedBranch(point[None], np.zeros(1), BranchEnd.NO_BEGINNING, int(first.code))

    def followed(precision: Precision, smallest: float) -> FollowedBranch:
        def change(point: np.ndarray, s: float) -> Change:
            given: PyTree = point, np.float64(s), precision
            value, by_point, by_s, code = map(
                np.asarray, _scene_along(problem.spec, line, like, *given)
            )
            return Change(value, by_point, by_s, int(code))

        scales = component_sizes(line.first, like)
        return follow_branch(change, point, scales=scales, smallest=smallest)

    branch = followed(ROUGH, _SMALLEST)
    # On stiff ground rough solves and long steps may lose the branch before it ends.
    lost = branch.end in (BranchEnd.WALK_ENDS, BranchEnd.BREAKS_OFF)
    return followed(_FINER, 0.1 * _SMALLEST) if lost else branch


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
    m, scene = point.shape[0], line.at(s)
    seeds, sizes = seed_directions(scene, tuple(range(len(jtu.tree_leaves(scene)))), m)
    start = state_with(scout.system, like, point)
    once = linearised_return(
        scout, seeds, start, precision, jnp.asarray(False), carries_parameters=jnp.asarray(True)
    )
    by_s = once.jacobian[:, m:] @ (line.slopes(s) / sizes)
    return once.recurring - point, once.jacobian[:, :m] - jnp.eye(m), by_s, once.code
