"""Critical values: where a gait's bifurcations lie in a parameter, and how that moves with others.

At a fold the Jacobian of x − P(x, s, q) has a left null vector w, so first derivatives are enough:
ds/dq = −(w · ∂P/∂q) / (w · ∂P/∂s). Where a multiplier leaves the unit circle elsewhere the gait
itself is regular, and its critical modulus ρ, at 1, is held: ds/dq = −(dρ/dq) / (dρ/ds). Source:
Kuznetsov, Elements of Applied Bifurcation Theory (2004), sections 10.2.1 and 10.3.1.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_type
from jaxbiped.continuation._bifurcations import BifurcationPoint, BranchEvent
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import axis_of
from jaxbiped.continuation._continue_gait import (
    ContinuationSetup,
    continuation_setup,
    first_gait,
    setup_of,
    traces_from,
)
from jaxbiped.continuation._trace import Trace
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_starts import state_of_guess
from jaxbiped.hybrid._hybrid_system import MINIMAL_SCENES
from jaxbiped.hybrid._sections import AbstractSection, section_of
from jaxbiped.scene._parameter_access import (
    parameter_names,
    parameter_values,
    select_parameters,
    with_parameters,
)
from jaxbiped.scene._scene import AbstractMinimalScene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

FACTOR = 8.0
"""How far a parameter is followed to both sides of its own value."""
STEEPEST = 0.1
"""How far the slope is followed to both sides of level ground [rad]."""
_NEAR = 1e-12
"""Relative distance to which the end of what a walker allows is found."""
STEPS: dict[str, Any] = dict(largest_step=0.02, max_points=200)
"""As of `continue_gait`."""
_CRITICAL = 1e-3
"""Distance of the largest multiplier's modulus from 1 up to which it is the critical one."""


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


def range_of(
    scene: AbstractMinimalScene, along: str, factor: float = FACTOR
) -> tuple[float, float]:
    """The range in which a gait is followed from a parameter's own value.

    It ends where the walker allows no more, as a foot's radius at the leg's length.

    Raises:
        ArgumentError: a parameter other than the slope that is zero.
    """
    own = float(parameter_values(scene)[along])
    if own == 0.0 and along != "slope":
        raise ArgumentError(f"along = {along!r} is not allowed where {along} is 0: no factor fits.")
    ends = (own / factor, own * factor) if own != 0.0 else (-STEEPEST, STEEPEST)
    low, high = sorted(farthest_allowed(scene, along, end) for end in ends)
    return low, high


def allows(scene: AbstractMinimalScene, values: Mapping[str, float]) -> bool:
    """Whether a walker may have these parameters."""
    try:
        with_parameters(scene, values)
    except ArgumentError:
        return False
    return True


def farthest_allowed(scene: AbstractMinimalScene, name: str, end: float) -> float:
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
    scene: AbstractMinimalScene,
    gait: Gait,
    along: str = "slope",
    *,
    section: AbstractSection | None = None,
    factor: float = FACTOR,
) -> NearestBifurcation:
    """Follows a gait along a parameter to both sides, up to the first bifurcation or limit.

    Args:
        scene: the scene of the gait.
        gait: gait at which to begin.
        along: the parameter's name (see `parameter_names`).
        section: section on which its cycles begin. Default: as of `find_gait`.
        factor: range to follow: from the parameter's value divided by this factor to its value
            times it, as far as the walker allows; on level ground, 0.1 rad of slope to both sides.

    Returns:
        Of the first events on both sides, the one whose value differs by the smaller factor. Events
        beyond a fold belong to another gait and do not count.

    Raises:
        ArgumentError: an argument is not allowed, or a parameter other than the slope is zero,
            which no factor changes; raised before anything is compiled.
    """
    scene = check_scene(scene, *MINIMAL_SCENES)
    section = section_of(scene, section)
    check_choice("along", along, parameter_names(scene))
    own = float(parameter_values(scene)[along])
    if not factor > 1.0:
        raise ArgumentError(f"factor = {factor!r} is not allowed: it must be above 1.")
    bounds = range_of(scene, along, factor)
    axis, steps = axis_of(scene, along, bounds, None), gait.step_lengths.shape[0] or None
    setup = continuation_setup(
        scene, axis, footsteps=steps, accuracy="balanced", engine="auto", section=section
    )
    begin = first_gait(setup, own, state_of_guess(scene, gait), "auto")
    parts: tuple[Trace, ...] = ()
    if not isinstance(begin, str):
        # What lies beyond a fold are other gaits.
        parts = traces_from(setup, begin, until=tuple(BranchEvent), **STEPS)
    return nearest_of(along, own, parts)


def nearest_of(along: str, own: float, parts: Sequence[Trace]) -> NearestBifurcation:
    """The nearest of the first events on traces that begin at a parameter's own value."""
    level = own == 0.0
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


class BifurcationSensitivities(NamedTuple):
    """Derivatives of a bifurcation's critical value with respect to p parameters.

    Attributes:
        along: name of the parameter whose critical value it is.
        value: that value, SI units.
        parameters: names of the p other parameters.
        slopes: derivatives of the value, SI units, shape (p,).
        errors: estimated errors of the derivatives, from a solve at a tolerance ten times looser,
            shape (p,).
        elasticities: relative change of the value over relative change of the parameter, (p,).
    """

    along: str
    value: float
    parameters: tuple[str, ...]
    slopes: np.ndarray
    errors: np.ndarray
    elasticities: np.ndarray


def bifurcation_sensitivities(
    branch: Branch,
    bifurcation: BifurcationPoint,
    parameters: tuple[str, ...] | None = None,
    *,
    accuracy: str = "tight",
) -> BifurcationSensitivities:
    """Derivatives of a bifurcation's value with respect to the scene's other parameters.

    Args:
        branch: from `continue_gait`.
        bifurcation: one of its folds, period doublings or Neimark–Sacker points.
        parameters: names (see `parameter_names`). Default: all except the branch's own.
        accuracy: "draft", "balanced" or "tight".

    Returns:
        The derivatives, with their errors.

    Raises:
        ArgumentError: an argument is not allowed; the point is a limit; or at a doubling or
            Neimark–Sacker point, another multiplier had already left the unit circle.
    """
    check_type("branch", branch, Branch)
    check_type("bifurcation", bifurcation, BifurcationPoint)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    without = (BranchEvent.LIMIT, BranchEvent.BRANCH_POINT, BranchEvent.NOT_LOCATED)
    if bifurcation.kind in without:
        raise ArgumentError(
            f"bifurcation is not allowed: a {bifurcation.kind} has no derivative; choose a fold, a "
            "period doubling or a Neimark–Sacker point."
        )
    scene, along = branch.scene_at(bifurcation), branch.along
    if parameters is None:
        names, _ = select_parameters(scene, None)
        parameters = tuple(name for name in names if name != along)
    names, _ = select_parameters(scene, (*parameters, along))
    by = _of_fold if bifurcation.kind is BranchEvent.FOLD else _of_modulus
    fine, loose = (-row[:-1] / row[-1] for row in by(branch, bifurcation, names, accuracy))
    values = np.array([float(parameter_values(scene)[name]) for name in names[:-1]])
    return BifurcationSensitivities(
        along=along,
        value=bifurcation.value,
        parameters=names[:-1],
        slopes=fine,
        errors=np.abs(fine - loose),
        elasticities=fine * values / bifurcation.value,
    )


def _of_fold(
    branch: Branch, fold: BifurcationPoint, names: tuple[str, ...], accuracy: str
) -> list[np.ndarray]:
    """Of the fine and of the looser solve, each of shape (p + 1,)."""
    setup = setup_of(branch, accuracy=accuracy)
    rows = fold_forcing(setup, fold.point.recurring, fold.value, names)
    if rows is None:
        raise ArgumentError(
            f"bifurcation at {branch.along} = {fold.value:.6g} is not allowed: its gait is not "
            f"found again at accuracy {accuracy!r}."
        )
    return list(rows)


def fold_forcing(
    setup: ContinuationSetup, recurring: np.ndarray, value: float, names: tuple[str, ...]
) -> np.ndarray | None:
    """How p parameters push the return map out of a fold: w · ∂P/∂q, up to a common factor.

    The recurring components (m,) and the value of the continued parameter are those of the fold.

    Returns:
        Of the cycle and of a ten times looser one, shape (2, p); None where it does not return.
    """
    scene = with_parameters(setup.scene, {setup.axis.name: value})
    known = parameter_values(scene)
    _, leaves = select_parameters(scene, names)
    values = [float(known[name]) for name in names]
    seen = setup.cycle_with(recurring, leaves, values, setup.arrivals)
    if int(seen.code[0]) != 0:
        return None
    m, sizes = len(recurring), setup.curve.sizes[:-1]
    rows = []
    for jacobian in seen.jacobian:
        left, _, _ = np.linalg.svd((jacobian[:, :m] - np.eye(m)) * sizes / sizes[:, None])
        rows.append((left[:, -1] / sizes) @ jacobian[:, m:])
    return np.stack(rows)


def _of_modulus(
    branch: Branch, point: BifurcationPoint, names: tuple[str, ...], accuracy: str
) -> list[np.ndarray]:
    """Derivatives of the critical modulus, and the same changed by their errors."""
    gait = find_gait(
        branch.scene_at(point),
        branch.state(point),
        footsteps=branch.footsteps,
        section=branch.section,
        accuracy=accuracy,
        parameters=names,
        engine=branch.engine,
    )
    radius = float(gait.measures.spectral_radius)
    if not abs(radius - 1.0) < _CRITICAL:
        raise ArgumentError(
            f"bifurcation at {branch.along} = {point.value:.6g} is not allowed: its critical "
            f"multiplier is not the gait's largest, whose modulus is {radius:.6g}."
        )
    slopes = np.asarray(gait.sensitivities.spectral_radius)
    return [slopes, slopes + np.asarray(gait.sensitivity_errors.spectral_radius)]
