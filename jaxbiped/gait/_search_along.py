"""Traced searches along a homotopy: what `jit` and `vmap` have in the place of `branch_along`.

The fitted start is tried first. Where no stable gait comes of it, the seed scene's gait is followed
along the line, each search beginning where those before point to.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.gait._fixed_point_search import FixedPointProblem, Found, Search, search, walks_only
from jaxbiped.gait._homotopy import BranchEnd, Homotopy, homotopy_to
from jaxbiped.gait._poincare_map import recurring_components
from jaxbiped.gait._search_provenance import FoundBy, Origin
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.linalg._small_matrices import eigenpairs

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
        searches=way.searches + 1,
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
