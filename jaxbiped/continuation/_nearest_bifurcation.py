"""Nearest bifurcation of a gait in one of its scene's parameters."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from jaxbiped._checks import ArgumentError, check_choice
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch_point import axis_of
from jaxbiped.continuation._continuation_setup import continuation_setup
from jaxbiped.continuation._continue_gait import first_gait, traces_from
from jaxbiped.continuation._trace import Trace
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_starts import state_of_guess
from jaxbiped.scene._abstract_scene import check_scene
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene

FACTOR = 8.0
"""How far a parameter is followed to both sides of its own value."""
STEEPEST = 0.1
"""How far the slope is followed to both sides of level ground [rad]."""
_NEAR = 1e-12
"""Relative distance to which the end of what a walker allows is found."""
_STEPS = dict(largest_step=0.02, max_points=200)
"""As of `continue_gait`."""


class NearestBifurcation(NamedTuple):
    """The first bifurcation or limit that a gait meets when a parameter grows or shrinks.

    Attributes:
        along: name of the parameter.
        kind: kind of the bifurcation or limit; None if there is none within the range that was
            followed.
        value: value of the parameter there, SI units; NaN for none.
        ratio: that value divided by the gait's own; NaN on level ground.
        multiplier: the critical multiplier there.
        error: estimated error of the multiplier.
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


def allows(scene: Scene | RigidScene, values: Mapping[str, float]) -> bool:
    """Whether a walker may have these parameters."""
    try:
        with_parameters(scene, values)
    except ArgumentError:
        return False
    return True


def farthest_allowed(scene: Scene | RigidScene, name: str, end: float) -> float:
    """The value of a parameter nearest to an end that the walker allows, seen from its own."""
    if allows(scene, {name: end}):
        return end
    inside, outside = float(parameter_values(scene)[name]), end
    while abs(outside - inside) > _NEAR * abs(inside):
        middle = 0.5 * (inside + outside)
        here = allows(scene, {name: middle})
        inside, outside = (middle, outside) if here else (inside, middle)
    return inside


def nearest_bifurcation(
    scene: Scene | RigidScene, gait: Gait, along: str = "slope", *, factor: float = FACTOR
) -> NearestBifurcation:
    """Follows a gait along a parameter to both sides, up to the first bifurcation or limit.

    Args:
        scene: the scene of the gait.
        gait: gait at which to begin.
        along: the parameter's name (see `parameter_names`).
        factor: range to follow: from the parameter's value divided by this factor to its value
            times it, as far as the walker allows; on level ground, 0.1 rad of slope to both sides.

    Returns:
        Of the first events on both sides, the one whose value differs by the smaller factor. Events
        beyond a fold belong to another gait and do not count.

    Raises:
        ArgumentError: an argument is not allowed, or a parameter other than the slope is zero,
            which no factor changes; raised before anything is compiled.
    """
    scene = check_scene(scene, Scene, RigidScene)
    check_choice("along", along, parameter_names(scene))
    own = float(parameter_values(scene)[along])
    if not factor > 1.0:
        raise ArgumentError(f"factor = {factor!r} is not allowed: it must be above 1.")
    bounds, level = range_of(scene, along, factor), own == 0.0
    axis, steps = axis_of(scene, along, bounds, None), gait.step_lengths.shape[0]
    setup = continuation_setup(scene, axis, footsteps=steps, accuracy="balanced", engine="auto")
    begin = first_gait(setup, own, state_of_guess(scene, gait), "auto")
    parts: tuple[Trace, ...] = ()
    if not isinstance(begin, str):
        # What lies beyond a fold are other gaits.
        parts = traces_from(setup, begin, until=tuple(BranchEvent), **_STEPS)
    first_seen = [each for part in parts for each in part.bifurcations[:1]]
    seen = [each for each in first_seen if level or each.value / own > 0.0]
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
