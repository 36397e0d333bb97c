"""Search without a guess, in stages: each only where those before found no stable gait."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import PyTree

from jaxbiped._progress import Stage, stage
from jaxbiped.gait._branch_along import TURNS, FollowedBranch, Searching, branch_along, state_at
from jaxbiped.gait._fixed_point_search import (
    FixedPointProblem,
    Found,
    Search,
    crossings_of,
    minimal_cycle,
    walks_only,
)
from jaxbiped.gait._homotopy import Homotopy, homotopy_to
from jaxbiped.gait._relaxation import has_seed_bodies, is_far_from_seed, relaxed
from jaxbiped.gait._return_map_spec import ReturnMapSpec, return_map_spec
from jaxbiped.gait._search_provenance import (
    MOST_OTHERS,
    BranchEnd,
    FoundBy,
    Origin,
    OtherGait,
    code_array,
    single_stage_origin,
)
from jaxbiped.gait._search_starts import default_guess, rolling_starts
from jaxbiped.gait._walk_waves import Walks, state_rows, walks_of
from jaxbiped.hybrid._scales import recurring_sizes
from jaxbiped.solve._accuracy import ACCURACIES

_PUSHES = (-0.05, -0.01, 0.01, 0.05)
"""Sizes (scaled) of the pushes off an unstable gait from which walks begin as well, and off a
shorter cycle from which longer ones are sought."""
_SCATTERED, _NEAR, _LATEST = 12, 8, 4
"""Starts of the last stage; points where a wave of walks came nearest to a return, and of how many
waves."""
_SAME = 1e-5
"""Relative difference of period and length up to which two finds are of one gait."""


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
        walks, searches: how many there were in all of the scene itself.
    """

    best: Seen | None
    others: tuple[Seen, ...]
    branch: FollowedBranch | None
    line: Homotopy | None
    walks: int
    searches: int


def search_in_stages(
    search: Searching, problem: FixedPointProblem, scout: ReturnMapSpec, first: Found, now: Stage
) -> Staged:
    """Searches on after Newton's method from the fitted start came to `first`.

    The branch is followed with `scout`: cycles of one footstep, in minimal coordinates. `now`
    counts the searches, and keeps in words what they found.
    """
    spec, modelled = problem.spec, problem.args.minimal
    seen: list[Seen] = []
    walks: list[Walks] = []
    branch = line = None
    searches = 1
    walker: Any = modelled
    if is_far_from_seed(modelled):
        line = homotopy_to(modelled)
        # Written as its line is, so that what walks there is compiled once.
        walker = modelled if line is None else line.last
    start = default_guess(modelled)
    sizes = recurring_sizes(modelled, start)

    def has_stable() -> bool:
        return any(each.radius < 1.0 and each.is_whole for each in seen)

    def add(found: Found, by: FoundBy) -> None:
        # What a walk itself settles on is one, however deep, but not where it stands and chatters.
        steps = spec.system.takes_steps(modelled, float(np.sum(found.last.advance)), spec.steps)
        sound = bool(found.sound) or (by is FoundBy.WALKING and bool(steps))
        known = any(_same(found, old) for old in seen)
        if int(found.ending) == int(Search.FOUND) and sound and not known:
            seen.append(Seen(found, by, spectral_radius(found), is_whole(found, problem)))
            best = min(each.radius for each in seen)
            now.update(0, f"{len(seen)} found, the smallest spectral radius {best:.4g}")

    def try_all(points: Sequence[np.ndarray] | np.ndarray, by: FoundBy) -> None:
        nonlocal searches
        for point in points:
            searches += 1
            add(search(problem._replace(guess=state_at(type(start), point)), TURNS), by)
            now.update()
            if has_stable():
                return

    def pushed() -> list[np.ndarray]:
        return [row for each in seen for row in _push_off(each.found, sizes)]

    def walk(**how: int) -> None:
        for each in walks_of(walker, pushed, **how) if scout.engine == "lanes" else ():
            walks.append(each)
            try_all(each.settled(), FoundBy.WALKING)
            if has_stable():
                return

    def follow() -> None:
        nonlocal line, branch
        with stage("following the seed's gait to this scene"):
            line = line or homotopy_to(modelled)
            if line is not None:
                branch = branch_along(
                    line,
                    search,
                    problem._replace(spec=scout),
                    start,
                    begins_at_model=begins_at_model,
                )
            if branch is not None and branch.end is BranchEnd.REACHED:
                try_all([branch.points[-1]], FoundBy.CONTINUATION)

    add(first, FoundBy.START)
    begins_at_model = line is not None and relaxed(walker) is None
    if begins_at_model and not has_stable():
        follow()
    if not has_stable():
        walk()
    shorter = [each for each in seen if not each.is_whole]
    if shorter and not has_stable():
        for each in shorter:
            try_all(_push_off(each.found, sizes), FoundBy.SCATTERED_STARTS)
    elif not has_stable() and not (line and (branch or any(s.by is FoundBy.WALKING for s in seen))):
        known = len(seen)
        follow()
        if len(seen) > known and not has_stable():
            walk(most=1)
    if not has_stable():
        with stage(f"searching from {_SCATTERED} scattered starts"):
            scattered = state_rows(rolling_starts(modelled, _SCATTERED, spread=0.5, seed=2))
            latest = [] if has_seed_bodies(modelled) else walks[-_LATEST:]
            near = [point for each in latest for point in each.near_returns(_NEAR)]
            try_all([*near, *scattered[1:]], FoundBy.SCATTERED_STARTS)
    ordered = sorted(seen, key=lambda each: (not each.is_whole, each.radius))
    best = ordered[0] if ordered else None
    walked = sum(len(each.counts) for each in walks)
    return Staged(best, tuple(ordered[1:]), branch, line, walked, searches)


def origin_of(staged: Staged, problem: FixedPointProblem) -> Origin:
    """What a search in stages tells of itself."""
    by = FoundBy.START if staged.best is None else staged.best.by
    plain = single_stage_origin(problem, by)
    columns: PyTree = np.full((MOST_OTHERS, 3 + len(problem.guess)), np.nan)
    for row, each in zip(columns, staged.others, strict=False):
        last = each.found.last
        row[:3] = float(last.period), float(last.advance[0]), each.radius
        row[3:] = 0.0, *np.asarray(each.found.recurring).tolist()
    period, length, radius, *state = columns.T
    plain = plain._replace(
        others=OtherGait(period, length, radius, type(problem.guess)(*state)),
        walks=code_array(staged.walks),
        searches=code_array(staged.searches),
    )
    if staged.branch is None or staged.line is None:
        return plain
    branch = staged.branch
    nearest = plain.nearest
    if branch.end is not BranchEnd.NO_BEGINNING:
        nearest = staged.line.at(np.float64(branch.s[branch.farthest]))
    return plain._replace(
        branch_end=code_array(branch.end),
        branch_walk_ending=code_array(branch.code),
        nearest=nearest,
    )


def search_on(
    search: Searching, problem: FixedPointProblem, first: Found, engine: str, now: Stage
) -> tuple[Found, Origin]:
    """The stages of a search beyond the first, which came to `first`: a gait, and its origin."""
    scene = problem.args
    scout = return_map_spec(
        scene.minimal,
        problem.guess,
        solver=None,
        engine=engine if scene.minimal is scene else "auto",
        max_solver_steps=ACCURACIES["balanced"].max_solver_steps,
    )
    staged = search_in_stages(search, problem, scout, first, now)
    found = walks_only(first) if staged.best is None else staged.best.found
    return found, origin_of(staged, problem)


def is_stable(found: Found, problem: FixedPointProblem) -> bool:
    """Whether a search came to a stable gait with all the footsteps that were asked for."""
    usable = int(found.ending) == int(Search.FOUND) and bool(found.sound)
    return usable and spectral_radius(found) < 1.0 and is_whole(found, problem)


def is_whole(found: Found, problem: FixedPointProblem) -> bool:
    """Whether a fixed point's cycle has all the footsteps that were asked for."""
    steps, last, m = problem.spec.steps, found.last, found.recurring.shape[0]
    if steps == 1:
        return True
    # The error is that of Newton's next correction.
    change = np.asarray(last.recurring) - np.asarray(crossings_of(last))[0]
    error, *_ = np.linalg.lstsq(np.eye(m) - np.asarray(last.jacobian)[:, :m], change)
    return int(minimal_cycle(last, error, float(problem.precision.rtol))) == steps


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


def _push_off(found: Found, sizes: np.ndarray) -> list[np.ndarray]:
    """States just off a gait, along its leading direction."""
    m = len(sizes)
    point = np.asarray(found.recurring)
    values, vectors = np.linalg.eig(np.asarray(found.last.jacobian)[:, :m])
    vector = vectors[:, np.argmax(np.abs(values))].real
    unit = vector / np.linalg.norm(vector / sizes)
    return [point + push * unit for push in _PUSHES]
