"""Curves of bifurcations in two parameters: a gait and its test function's zero, followed together.

Kuznetsov, Elements of Applied Bifurcation Theory (2004), section 10.3.1: the equations of the gait
are extended by one for the bifurcation, the unknowns by the first parameter.
"""

from itertools import islice
from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_positive, check_type
from jaxbiped.continuation._bifurcations import (
    BifurcationPoint,
    BranchEvent,
    critical_multiplier,
    multiplier_test,
)
from jaxbiped.continuation._branch import Branch
from jaxbiped.continuation._branch_point import (
    Axis,
    BranchPoint,
    axis_of,
    branch_point,
    change_of,
    multipliers_of,
)
from jaxbiped.continuation._continue_gait import ContinuationSetup, setup_of
from jaxbiped.continuation._trace import BOUND, BranchStop, is_bound, leaves_range, reason_of
from jaxbiped.gait._pseudo_arclength import Change, Curve, CurvePoint, StepControl, correct, follow
from jaxbiped.gait._search_provenance import BranchEnd
from jaxbiped.scene._parameter_access import parameter_quantities, parameter_values
from jaxbiped.solve._accuracy import GAIT_ACCURACIES

_DIFFERENCE = 1e-4
"""Step of the test function's difference quotients, in the sizes of the curve."""
_CONVERGED = 1e-7
_SMALLEST, _ASIDE = 1e-4, 0.05


class BifurcationCurve(NamedTuple):
    """Bifurcations of one kind along two parameters, n points in order.

    Attributes:
        kind: kind of the bifurcations.
        along: names of the two parameters.
        units: SI units of the two parameters.
        values: values of the two parameters, SI units, shape (n, 2).
        points: the gaits; their `value` is that of the first parameter.
        multipliers: the critical multipliers, shape (n,), complex.
        errors: estimated errors of the multipliers, shape (n,).
        stops: how the curve ended at its two ends.
    """

    kind: BranchEvent
    along: tuple[str, str]
    units: tuple[str, str]
    values: np.ndarray
    points: tuple[BranchPoint, ...]
    multipliers: np.ndarray
    errors: np.ndarray
    stops: tuple[BranchStop, BranchStop]


def bifurcation_curve(
    branch: Branch,
    bifurcation: BifurcationPoint,
    along: str,
    *,
    bounds: tuple[float, float],
    log: bool | None = None,
    largest_step: float = 0.1,
    max_points: int = 40,
    accuracy: str = "tight",
    engine: str = "auto",
) -> BifurcationCurve:
    """Follows a bifurcation of a branch along a second parameter, in both directions.

    Args:
        branch: from `continue_gait`; the curve ends at the first point beyond its range.
        bifurcation: one of its folds, period doublings or Neimark–Sacker points.
        along: name of the second parameter.
        bounds: range (from, to) of the second parameter, SI units; the scene's own value must lie
            in it.
        log: whether equal steps are equal factors. Default: if a positive range spans two decades.
        largest_step: maximum arclength of a step (see `continue_gait`).
        max_points: maximum number of points in each direction.
        accuracy: "balanced" or "tight"; multipliers are differentiated by differences.
        engine: "xla", "lanes" or "auto" (see `ENGINES`).

    Returns:
        The curve.

    Raises:
        ArgumentError: an argument is not allowed, or the bifurcation is not found again.
    """
    check_type("branch", branch, Branch)
    check_type("bifurcation", bifurcation, BifurcationPoint)
    if bifurcation.kind in (BranchEvent.LIMIT, BranchEvent.NOT_LOCATED):
        raise ArgumentError(
            f"bifurcation is not allowed: {bifurcation} is not a zero of a test function."
        )
    second = axis_of(branch.scene, along, bounds, log)
    if along == branch.along:
        raise ArgumentError(f"along = {along!r} is not allowed: the branch itself follows it.")
    check_positive("largest_step", largest_step, one=True)
    check_count("max_points", max_points)
    check_choice("accuracy", accuracy, GAIT_ACCURACIES)
    own = float(parameter_values(branch.scene)[along])
    if not second.first <= own <= second.last:
        raise ArgumentError(f"bounds = {bounds!r} is not allowed: {along} = {own:g} is outside.")
    setup = setup_of(branch, accuracy=accuracy, engine=engine)
    curve = _extended_curve(setup, second, bifurcation.kind)
    place = np.append(bifurcation.point.place, second.place(own))
    begin = correct(curve, place, patient=True).found
    if begin is None:
        raise ArgumentError(
            f"bifurcation at {branch.along} = {bifurcation.value:.6g} is not allowed: it is not "
            f"found again at accuracy {accuracy!r}."
        )
    ways = [
        _follow(curve, begin._replace(tangent=way * begin.tangent), largest_step, max_points)
        for way in (-1.0, 1.0)
    ]
    (before, first_stop), (after, last_stop) = ways
    found = [*reversed(before), begin, *after]
    return _curve_through(setup, second, bifurcation.kind, found, (first_stop, last_stop))


def _extended_curve(setup: ContinuationSetup, second: Axis, kind: BranchEvent) -> Curve:
    """Gaits at the bifurcation: unknown are their components and the first parameter's s."""
    sizes = np.append(setup.curve.sizes, 1.0)
    m = len(sizes) - 2

    def gait(place: np.ndarray) -> Change:
        return _gait_at(setup, second, place)

    def change(point: np.ndarray, s: float) -> Change:
        place = np.append(point, s) / sizes
        here = gait(place)
        if here.code != 0:
            return here
        test = multiplier_test(kind, multipliers_of(here))
        slopes = np.empty(m + 2)
        for k, shift in enumerate(_DIFFERENCE * np.eye(m + 2)):
            beside = gait(place + shift)
            if beside.code != 0:
                return beside
            slopes[k] = (multiplier_test(kind, multipliers_of(beside)) - test) / _DIFFERENCE
        slopes /= sizes
        by_second = here.seen.jacobian[0][:, m + 1] * second.slope(s)
        return Change(
            value=np.append(here.value, test),
            by_point=np.vstack([np.column_stack([here.by_point, here.by_s]), slopes[:-1]]),
            by_s=np.append(by_second, slopes[-1]),
            code=0,
            seen=here.seen,
        )

    return Curve(change, sizes, _CONVERGED)


def _gait_at(setup: ContinuationSetup, second: Axis, place: np.ndarray) -> Change:
    """What a cycle changes at a place of the extended curve."""
    *scaled, s, t = place
    first, point = setup.axis, np.array(scaled) * setup.curve.sizes[:-1]
    values = [first.value(float(s)), second.value(float(t))]
    seen = setup.cycle_with(point, (first.leaf, second.leaf), values, setup.arrivals)
    return change_of(seen, point, first.slope(float(s)))


def _follow(
    curve: Curve, begin: CurvePoint, largest_step: float, max_points: int
) -> tuple[list[CurvePoint], BranchStop]:
    """The points beyond one, and how they end; a stop's value is still that of s."""
    found: list[CurvePoint] = []

    def stopped(end: BranchEnd, cause: str) -> tuple[list[CurvePoint], BranchStop]:
        return found, BranchStop(end, cause, float([begin, *found][-1].place[-1]))

    if leaves_range(begin):
        return stopped(BranchEnd.REACHED, BOUND)
    control = StepControl(0.25 * largest_step, largest_step, _SMALLEST, aside=_ASIDE)
    for attempt in islice(follow(curve, begin, control, low=0.0, high=1.0), max_points):
        if attempt.found is None:
            return stopped(*reason_of(attempt.code))
        found.append(attempt.found)
        if is_bound(attempt.found) or not 0.0 <= attempt.found.place[-2] <= 1.0:
            return stopped(BranchEnd.REACHED, BOUND)
    return stopped(BranchEnd.UNFINISHED, f"{max_points} points were followed")


def _curve_through(
    setup: ContinuationSetup,
    second: Axis,
    kind: BranchEvent,
    found: list[CurvePoint],
    stops: tuple[BranchStop, BranchStop],
) -> BifurcationCurve:
    inner = setup.curve
    points = []
    for each in found:
        # A corrector's own evaluation is that before its last correction, and multipliers may
        # change a hundred times as fast as places.
        seen = _gait_at(setup, second, each.place)
        change = each.change if seen.code else seen
        there = each._replace(place=each.place[:-1], change=change)
        points.append(branch_point(inner, setup.axis, there))
    critical = [critical_multiplier(kind, point) for point in points]
    seconds = [second.value(float(each.place[-1])) for each in found]
    first_stop, last_stop = (stop._replace(value=second.value(stop.value)) for stop in stops)
    quantities = parameter_quantities(setup.scene)
    return BifurcationCurve(
        kind=kind,
        along=(setup.axis.name, second.name),
        units=(quantities[setup.axis.name].unit, quantities[second.name].unit),
        values=np.array([(p.value, b) for p, b in zip(points, seconds, strict=True)]),
        points=tuple(points),
        multipliers=np.array([value for value, _, _ in critical]),
        errors=np.array([error for _, error, _ in critical]),
        stops=(first_stop, last_stop),
    )
