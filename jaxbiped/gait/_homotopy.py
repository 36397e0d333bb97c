"""Homotopy: the line in the parameters from the seed's scene to another of the same laws.

A search that fails from its start follows the seed's gait along this line to scenes far from it.
"""

from collections.abc import Callable
from itertools import islice
from typing import NamedTuple

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._ending import NamedCode
from jaxbiped._types import Scalar
from jaxbiped.gait._pseudo_arclength import (
    Change,
    Curve,
    CurvePoint,
    StepControl,
    correct,
    follow,
    locate,
)
from jaxbiped.gait._relaxation import like_model, relaxed, seed_like
from jaxbiped.scene._abstract_scene import AbstractWalkerScene
from jaxbiped.scene._scene import Scene
from jaxbiped.scene._walker import Walker

_CONTROL = StepControl(first=0.08, largest=0.35, smallest=2e-4)
_CONVERGED = 2e-5
"""Size of a correction that ends the corrector."""
_MOST_STEPS = 150
_AT_END = 1e-9
_BEYOND_FOLD, _BACK = 24, 0.25
"""Steps, and distance in s, for which a branch is followed back behind its first fold."""


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
    if isinstance(scene.walker, Walker):
        return Homotopy(scene.with_minimal(seed_like(scene.minimal)), scene)
    both = relaxed(scene) if isinstance(scene, Scene) else None
    return line_from_model(scene) if both is None else Homotopy(*both)


def line_from_model(scene: AbstractWalkerScene) -> Homotopy | None:
    """The line from the walker with the legs of a model whose gait is known (see `like_model`)."""
    both = like_model(scene) if isinstance(scene, Scene) else None
    return None if both is None else Homotopy(*both)


class BranchEnd(NamedCode):
    """How a branch of gaits ended. `str(end)` is its name in words.

    - not followed: there was no need to.
    - reached: it reached the requested scene.
    - fold: it turned back at a fold.
    - walk ends: beyond this point, the walk of the gait ends (see its `Ending`).
    - breaks off: the return map is not smooth there, for example because a foot begins to scuff.
    - no beginning: there is no known gait at which to begin.
    - unfinished: the maximum number of steps was reached.
    - no walk: beyond this point, the orbit is not a walk (see `Search`).
    - closed: it returned to its beginning.
    - branches off: it begins at another branch.
    - jumped: a step led back to gaits that were already followed.
    - interrupted: by Ctrl-C.
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
    INTERRUPTED = 11


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
