"""Nearest bifurcation of a gait in one of its scene's parameters."""

import math
from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._continue_gait import continue_gait
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.gait._gait import Gait
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene

FACTOR = 8.0
"""How far a parameter is followed to both sides of its own value."""
STEEPEST = 0.1
"""How far the slope is followed to both sides of level ground [rad]."""
_NEAR = 1e-12
"""Relative distance to which the end of what a walker allows is found."""


class NearestBifurcation(NamedTuple):
    """What a gait comes to first when a parameter grows or shrinks.

    Attributes:
        along: name of the parameter.
        kind: what happens there; None where nothing does within the range that was followed.
        value: of the parameter there, SI units; NaN for none.
        ratio: of that value to the gait's own; NaN on level ground.
        multiplier: the critical multiplier there.
        error: its estimated error.
    """

    along: str
    kind: BranchEvent | None
    value: float
    ratio: float
    multiplier: complex
    error: float


def range_of(scene: Scene | RigidScene, along: str, factor: float = FACTOR) -> tuple[float, float]:
    """The range in which a gait is followed from a parameter's own value.

    It ends where the walker allows no more, as a foot's radius at the leg's length.

    Raises:
        ArgumentError: a parameter other than the slope that is zero.
    """
    own = float(parameter_values(scene)[along])
    if own == 0.0 and along != "slope":
        raise ArgumentError(f"along = {along!r} is not allowed where {along} is 0: no factor fits.")
    ends = (own / factor, own * factor) if own != 0.0 else (-STEEPEST, STEEPEST)
    low, high = (farthest_allowed(scene, along, end) for end in ends)
    return low, high


def farthest_allowed(scene: Scene | RigidScene, name: str, end: float) -> float:
    """The value of a parameter nearest to an end that the walker allows, seen from its own."""

    def allowed(value: float) -> bool:
        try:
            with_parameters(scene, {name: value})
        except ArgumentError:
            return False
        return True

    if allowed(end):
        return end
    inside, outside = float(parameter_values(scene)[name]), end
    while abs(outside - inside) > _NEAR * abs(inside):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if allowed(middle) else (inside, middle)
    return inside


def nearest_bifurcation(
    scene: Scene | RigidScene, gait: Gait, along: str = "slope", *, factor: float = FACTOR
) -> NearestBifurcation:
    """Follows a gait in a parameter to both sides, and tells the first bifurcation or limit.

    Args:
        scene: the gait's.
        gait: where to begin.
        along: the parameter's name (see `parameter_names`).
        factor: how far to follow it: from its own value over this to its own times this, or to
            where the walker allows no more; the slope of level ground by 0.1 rad to both sides.

    Returns:
        Of the first on each side along the branch, the one whose value differs by the smaller
        factor: what lies beyond a fold is another gait's.

    Raises:
        ArgumentError: an argument that is not allowed, before anything is compiled; a parameter
            other than the slope that is zero, which no factor changes.
    """
    scene = check_scene(scene, Scene, RigidScene)
    check_choice("along", along, parameter_names(scene))
    own = float(parameter_values(scene)[along])
    if not factor > 1.0:
        raise ArgumentError(f"factor = {factor!r} is not allowed: it must be above 1.")
    bounds, level = range_of(scene, along, factor), own == 0.0
    steps = gait.step_lengths.shape[0]
    branch = continue_gait(scene, along, bounds=bounds, guess=gait, footsteps=steps)
    seen = [each for each in _first_each_way(branch, gait, own) if level or each.value / own > 0.0]
    if not seen:
        return NearestBifurcation(along, None, math.nan, math.nan, complex(math.nan), math.nan)

    def distance(value: float) -> float:
        return abs(value) if level else abs(math.log(value / own))

    def nearest(each: BifurcationPoint) -> float:
        # One that was not located lies between two values.
        ends = (each.value,) if math.isnan(each.beyond) else (each.value, each.beyond)
        return min(map(distance, ends))

    first = min(seen, key=nearest)
    ratio = math.nan if level else first.value / own
    return NearestBifurcation(along, first.kind, first.value, ratio, first.multiplier, first.error)


def _first_each_way(branch: Branch, gait: Gait, own: float) -> list[BifurcationPoint]:
    """What a branch comes to first on both sides of one of its gaits, at the parameter's own value.

    Beyond a fold the branch passes the same values once more, with other gaits.
    """
    values = [each.value for each in branch.points]
    at = [k for k, value in enumerate(values) if math.isclose(value, own, abs_tol=_NEAR)]
    if not at:
        return []
    state = np.stack(recurring_leaves(gait.measures.state))
    own_place = min(at, key=lambda k: float(np.max(np.abs(branch.points[k].recurring - state))))
    places = [each.place for each in branch.points]
    before: list[BifurcationPoint] = []
    after: list[BifurcationPoint] = []
    for each in branch.bifurcations:
        where = next(k for k, place in enumerate(places) if np.array_equal(place, each.point.place))
        (after if where > own_place else before).append(each)
    return [*before[-1:], *after[:1]]
