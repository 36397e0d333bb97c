"""Homotopy: the line in the parameters from the seed's scene to another of the same laws.

A search that fails from its start follows the seed's gait along this line to scenes far from it.
Here is the traced search, which `jit` and `vmap` have in the place of `branch_along`: the fitted
start is tried first; where no stable gait comes of it, the first scene's gait is followed along the
line, each search beginning where those before point to.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.gait._fixed_point_search import FixedPointProblem, Found, Search, search, walks_only
from jaxbiped.gait._poincare_map import recurring_components
from jaxbiped.gait._relaxation import (
    has_seed_bodies,
    is_far_from_seed,
    like_model,
    relaxed,
    seed_like,
)
from jaxbiped.gait._search_provenance import BranchEnd, FoundBy, Origin
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.linalg._small_matrices import eigenpairs
from jaxbiped.scene._scene import AbstractWalkerScene

_FIRST_STEP, _LARGEST_STEP, _LEAST_STEP = 0.05, 0.3, 1e-3
"""Steps along the line: the first, at most, and at which it is given up."""
_FLOOR, _JUMP, _ASIDE = 0.1, 0.2, 0.5
"""Size below which components count as of one size; how far, relative to it, the first step may
lead, and others aside from where they pointed, in units of their length: else it is another gait's
branch that they came to."""
_MOST_SEARCHES = 80


class Homotopy(NamedTuple):
    """Scenes between two of one kind: geometric in what is positive in both, linear in the rest.

    Attributes:
        first, last: the scenes at s = 0 and at s = 1.
    """

    first: AbstractWalkerScene
    last: AbstractWalkerScene

    def at(self, s: Scalar | float) -> AbstractWalkerScene:
        """The scene at s; beyond 1 the line goes on."""
        return jtu.tree_map(lambda a, b: _interpolate(a, b, s)[0], self.first, self.last)

    def slopes(self, s: Scalar | float) -> Scalar:
        """Derivatives of the scene's leaves with respect to s, shape (leaves,)."""
        pairs = zip(jtu.tree_leaves(self.first), jtu.tree_leaves(self.last), strict=True)
        return jnp.stack([_interpolate(a, b, s)[1] for a, b in pairs])


def _interpolate(a: Scalar, b: Scalar, s: Scalar | float) -> tuple[Scalar, Scalar]:
    """The number at s between `a` and `b`, and its derivative with respect to s."""
    geometric = (a > 0.0) & (b > 0.0)
    ratio = jnp.where(geometric, b, 1.0) / jnp.where(geometric, a, 1.0)
    # Exactly the last number at s = 1.
    power = jnp.where(s == 1.0, b, a * ratio**s)
    value = jnp.where(geometric, power, (1.0 - s) * a + s * b)
    return value, jnp.where(geometric, power * jnp.log(ratio), b - a)


def homotopy_to(scene: AbstractWalkerScene) -> Homotopy | None:
    """The line to `scene` from the seed's scene, its laws made to resemble the seed's.

    For a walker of other bodies it begins at the same walker relaxed (see `relaxed`); where there
    is nothing to relax, as `line_from_model`. None where there is no such line.

    Numbers of laws that are not in the catalogue stay those of `scene`. Its actuators are idle.
    """
    if has_seed_bodies(scene):
        return Homotopy(scene.with_minimal(seed_like(scene.minimal)), scene)
    if not is_far_from_seed(scene):
        return None
    both = relaxed(scene)
    return line_from_model(scene) if both is None else Homotopy(*both)


def line_from_model(scene: AbstractWalkerScene) -> Homotopy | None:
    """The line from the walker with the legs of a model whose gait is known (see `like_model`)."""
    both = like_model(scene)
    return None if both is None else Homotopy(*both)


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
