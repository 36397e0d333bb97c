"""Branch of gaits along a homotopy, from its first scene towards the one asked for.

Under `jit` and `vmap` the fitted start is tried first. Where no stable gait comes of it, the seed
scene's gait is followed along the line, each search beginning where those before point to.
"""

from collections.abc import Callable
from itertools import chain
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar, as_float, select
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._state_quantities import state_of_recurring
from jaxbiped.gait._fixed_point_search import (
    ROUGH,
    FixedPointProblem,
    Found,
    Search,
    search,
    walks_only,
)
from jaxbiped.gait._homotopy import BranchEnd, FollowedBranch, Homotopy, follow_branch, homotopy_to
from jaxbiped.gait._poincare_map import (
    linearised_return,
    recurring_components,
    seed_directions,
    state_with,
)
from jaxbiped.gait._pseudo_arclength import Change
from jaxbiped.gait._return_map_spec import ReturnMapSpec, runs_by_lanes
from jaxbiped.gait._search_provenance import FoundBy, Origin
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.gait._walk_waves import is_far_from_seed, walks_of
from jaxbiped.linalg._small_matrices import eigenpairs
from jaxbiped.scene._state_types import WalkerState
from jaxbiped.scene._walker import Walker
from jaxbiped.solve._accuracy import Precision
from jaxbiped.solve._units import recurring_sizes

_TURNS = 20
"""Turns that each search may take."""
_SMALLEST, _FINER = 2e-4, Precision(3e-7, 3e-6)
"""Step at which the seed's gait is lost; how exactly it is then followed again, by finer steps."""
_LEAPS, _GAPS = 4, (0.01, 0.05)
"""Leaps over kinks of a branch at most, and how far each leads in s."""

Searching = Callable[[FixedPointProblem, int], Found]
"""Newton's method on a return map from a guess, in at most so many evaluations."""


def state_at(kind: type, point: np.ndarray) -> WalkerState:
    """The state with these components besides hip_x, of numbers that take no time to make."""
    return jtu.tree_map(as_float, state_of_recurring(kind, point.tolist()))


def branch_along(
    line: Homotopy, search: Searching, problem: FixedPointProblem, like: WalkerState
) -> FollowedBranch:
    """The branch of gaits from a line's first scene.

    Args:
        line: the scenes.
        search: Newton's method, for the first gait and behind kinks of the branch.
        problem: of cycles of one footstep, in minimal coordinates.
        like: a state of the scenes.
    """
    begin: Any = line.first
    start = default_guess(begin)
    first = search(problem._replace(args=begin, guess=start), _TURNS)
    if int(first.ending) != int(Search.FOUND) and not isinstance(begin.walker, Walker):
        for point in (row for walks in walks_of(begin, list) for row in walks.settled()):
            there = state_at(type(start), point)
            first = search(problem._replace(args=begin, guess=there), _TURNS)
            if int(first.ending) == int(Search.FOUND):
                break
    point = np.asarray(first.recurring)
    if int(first.ending) != int(Search.FOUND):
        return FollowedBranch(point[None], np.zeros(1), BranchEnd.NO_BEGINNING, int(first.code))

    def followed(
        point: np.ndarray, s: float, precision: Precision = ROUGH, smallest: float = _SMALLEST
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
        return followed(point, 0.0, _FINER, 0.1 * _SMALLEST)
    for _ in range(_LEAPS):
        beyond = _beyond(search, problem, line, branch) if branch.is_lost else None
        tail = None if beyond is None else followed(*beyond)
        if tail is None or tail.end is BranchEnd.NO_BEGINNING:
            break
        branch = tail
    return branch


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

        def found_from(point: np.ndarray, scene: Any = scene, kind: type = kind) -> Found:
            return search(problem._replace(args=scene, guess=state_at(kind, point)), _TURNS)

        about = walks_of(scene, lambda: [last], most=1)
        settled = (row for walks in about for row in walks.settled())
        for found in map(found_from, chain([last], settled)):
            if int(found.ending) == int(Search.FOUND) and bool(found.sound):
                return np.asarray(found.recurring), s
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
    m, scene = point.shape[0], line.at(s)
    seeds, sizes = seed_directions(scene, tuple(range(len(jtu.tree_leaves(scene)))), m)
    start = state_with(scout.system, like, point)
    once = linearised_return(
        scout, seeds, start, precision, jnp.asarray(False), carries_parameters=jnp.asarray(True)
    )
    by_s = once.jacobian[:, m:] @ (line.slopes(s) / sizes)
    return once.recurring - point, once.jacobian[:, :m] - jnp.eye(m), by_s, once.code


_FIRST_STEP, _LARGEST_STEP, _LEAST_STEP = 0.05, 0.3, 1e-3
"""Steps along the line: the first, at most, and at which it is given up."""
_FLOOR, _JUMP, _ASIDE = 0.1, 0.2, 0.5
"""Size below which components count as of one size; how far, relative to it, the first step may
lead, and others aside from where they pointed, in units of their length: else it is another gait's
branch that they came to."""
_MOST_SEARCHES = 80


class _Way(NamedTuple):
    """How far along the line a search is.

    Attributes:
        s: of the next search; negative for the search from the fitted start, at the end of the
            line.
        step: from the last gait that was found on the line.
        latest_point, before: points of the last gait found on the line and of the one before it,
            with their places `at`, shape (2,).
        ahead: the point that the next search begins from.
        best: the gait to be returned, `radius` its spectral radius, infinite where there is none.
        origin: what will be told.
        searches: how many there were.
        over: whether there is nothing left to do.
    """

    s: Scalar
    step: Scalar
    latest_point: Scalar
    before: Scalar
    at: Scalar
    ahead: Scalar
    best: Found
    radius: Scalar
    origin: Origin
    searches: Scalar
    over: Scalar


def search_along(problem: FixedPointProblem, origin: Origin) -> tuple[Found, Origin]:
    """The traced search: from the guess, and along the line from the seed's scene where need be."""
    line, system = homotopy_to(problem.args), problem.spec.system
    # Origins have scenes of the problem's own kind.
    own: PyTree = jtu.tree_structure(problem.args)
    if line is None or jtu.tree_structure(line.last) != own:
        return walks_only(search(problem)), origin
    fitted = recurring_components(system, problem.guess)
    first = recurring_components(system, default_guess(line.first.minimal))

    def run(way: _Way) -> Found:
        there = line.at(jnp.where(way.s < 0.0, 1.0, way.s))
        return search(problem._replace(args=there, guess=problem.state(way.ahead)), ~way.over)

    shape = jax.eval_shape(lambda: search(problem, jnp.asarray(True)))
    no_return = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shape)
    begin = _Way(
        s=jnp.asarray(-1.0),
        step=jnp.asarray(_FIRST_STEP),
        latest_point=fitted,
        before=fitted,
        at=jnp.zeros(2),
        ahead=fitted,
        best=no_return,
        radius=jnp.asarray(jnp.inf),
        origin=jax.tree.map(jnp.asarray, origin),
        searches=jnp.asarray(0),
        over=jnp.asarray(False),
    )
    end = jax.lax.while_loop(
        lambda way: ~way.over,
        lambda way: select(way.over, way, _after(way, run(way), line, first)),
        begin,
    )
    return walks_only(end.best), end.origin


def _after(way: _Way, latest: Found, line: Homotopy, first: Scalar) -> _Way:
    """One search further; `first` is where that of the seed's gait begins."""
    from_start, from_seed = way.s < 0.0, way.s == 0.0
    found = latest.ending == int(Search.FOUND)
    found &= from_start | from_seed | _is_ahead(way, latest.recurring)
    radius = jnp.where(found & latest.sound, _radius(latest), jnp.inf)
    at_end = from_start | (way.s == 1.0)
    # What the fitted start gave is kept where nothing better comes, found or not.
    better = from_start | (at_end & (radius < way.radius))
    on_line = found & ~from_start
    at = jnp.where(on_line, jnp.stack([jnp.where(from_seed, 0.0, way.at[1]), way.s]), way.at)
    # The first gait on the line has none before it.
    before = jnp.where(
        on_line, jnp.where(from_seed, latest.recurring, way.latest_point), way.before
    )
    latest_point = jnp.where(on_line, latest.recurring, way.latest_point)
    grown = jnp.minimum(jnp.where(from_seed, way.step, 1.5 * way.step), _LARGEST_STEP)
    step = jnp.where(from_start, way.step, jnp.where(found, grown, 0.4 * way.step))
    lost = ~found & ~from_start
    given_up = lost & (from_seed | (step < _LEAST_STEP)) | (way.searches >= _MOST_SEARCHES)
    over = (from_start & found & (radius < 1.0)) | (found & (way.s == 1.0)) | given_up
    end = jnp.where(from_seed, int(BranchEnd.NO_BEGINNING), int(BranchEnd.BREAKS_OFF))
    end = jnp.where(lost & (latest.code != 0), int(BranchEnd.WALK_ENDS), end)
    end = jnp.where(found, int(BranchEnd.UNFINISHED), end)
    end = jnp.where(found & (way.s == 1.0), int(BranchEnd.REACHED), end)
    followed = over & ~from_start
    s = jnp.where(from_start, 0.0, jnp.minimum(at[1] + step, 1.0))
    share = (s - at[1]) / jnp.where(at[1] > at[0], at[1] - at[0], 1.0)
    ahead = jnp.where(from_start, first, latest_point + share * (latest_point - before))
    origin = way.origin._replace(
        found_by=jnp.where(better & ~from_start, int(FoundBy.CONTINUATION), way.origin.found_by),
        branch_end=jnp.where(followed, end, way.origin.branch_end),
        branch_walk_ending=jnp.where(followed & lost, latest.code, way.origin.branch_walk_ending),
        nearest=select(followed & ~from_seed, line.at(at[1]).minimal, way.origin.nearest),
    )
    return _Way(
        s=s,
        step=step,
        latest_point=latest_point,
        before=before,
        at=at,
        ahead=ahead,
        best=select(better, latest, way.best),
        radius=jnp.where(better, radius, way.radius),
        origin=origin,
        searches=way.searches + 1,
        over=over,
    )


def _is_ahead(way: _Way, point: Scalar) -> Scalar:
    """Whether a point lies where those before it on the line point to."""

    def distance(a: Scalar, b: Scalar) -> Scalar:
        return jnp.max(jnp.abs(a - b) / (_FLOOR + jnp.abs(way.latest_point)))

    aside, length = distance(point, way.ahead), distance(point, way.latest_point)
    return jnp.where(way.at[1] > way.at[0], aside < _ASIDE * length + 0.01, length < _JUMP)


def _radius(found: Found) -> Scalar:
    """Largest absolute value of a Floquet multiplier: on the section the trivial one is zero."""
    jacobian = found.last.jacobian[:, : found.recurring.shape[0]]
    finite = jnp.all(jnp.isfinite(jacobian))
    values, _ = eigenpairs(jnp.where(finite, jacobian, 0.0))
    return jnp.where(finite, jnp.max(jnp.abs(values)), jnp.inf)
