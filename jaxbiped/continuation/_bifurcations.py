"""Bifurcations on a branch: where multipliers cross the unit circle, located between its points.

Test functions that change sign there: Kuznetsov, Elements of Applied Bifurcation Theory (2004),
section 10.2.2.
"""

import enum
from collections.abc import Callable
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from jaxbiped.continuation._branch_point import (
    Axis,
    BranchPoint,
    branch_point,
    multipliers_of,
    witness_curve,
)
from jaxbiped.gait._pseudo_arclength import Curve, CurvePoint, correct, locate

_REAL = 1e-9
"""Imaginary part up to which a multiplier counts as real."""
_BESIDE = (1e-3, 1e-2)
"""Arclengths to both sides of a bifurcation between which another curve's is looked for."""
_AT = 1e-3
"""Distance from the unit circle that a located multiplier may have."""


class BranchEvent(enum.StrEnum):
    """Kind of a special point of a branch.

    - fold: a multiplier at +1; two branches meet, and the parameter turns back.
    - period-doubling: one at −1; gaits of twice the footsteps branch off.
    - neimark-sacker: a complex pair on the unit circle.
    - branch-point: one at +1 where the parameter does not turn back: branches cross.
    - limit: the branch ends at a limit of the model (see `LimitCause`).
    - not-located: multipliers cross the unit circle between two neighbouring points, but the
      crossing was not located.
    """

    FOLD = "fold"
    PERIOD_DOUBLING = "period-doubling"
    NEIMARK_SACKER = "neimark-sacker"
    BRANCH_POINT = "branch-point"
    LIMIT = "limit"
    NOT_LOCATED = "not-located"


EVENTS = tuple(BranchEvent)
"""In the order of their codes in datasets."""
_CRITICAL = {
    BranchEvent.FOLD: 1.0,
    BranchEvent.PERIOD_DOUBLING: -1.0,
    BranchEvent.BRANCH_POINT: 1.0,
    BranchEvent.NEIMARK_SACKER: float("nan"),
}
"""Where the critical multiplier lies."""


class BifurcationPoint(NamedTuple):
    """A special point of a branch.

    Attributes:
        kind: kind of the point.
        point: the gait there; at a limit, the last gait before it; if the bifurcation was not
            located, the gait at one end of the interval.
        multiplier: the critical multiplier; at a limit, the largest one; if the bifurcation was not
            located, the one nearest to the unit circle.
        error: estimated error of the multiplier.
        value_error: estimated error of the parameter's value, SI units: the distance to the same
            bifurcation in a solve at a tolerance ten times looser, or the error that follows from
            that of the critical multiplier, whichever is larger. NaN at a limit, and at a fold that
            the looser solve does not have nearby. If the bifurcation was not located, the length of
            the interval.
        beyond: if the bifurcation was not located, the parameter's value at the other end of the
            interval, SI units; otherwise NaN.
    """

    kind: BranchEvent
    point: BranchPoint
    multiplier: complex
    error: float
    value_error: float = float("nan")
    beyond: float = float("nan")

    def __str__(self) -> str:
        if self.kind is BranchEvent.NOT_LOCATED:
            return f"{self.kind} between {self.beyond:.6g} and {self.value:.6g}"
        return f"{self.kind} at {self.value:.6g}"

    @property
    def value(self) -> float:
        """Value of the parameter, SI units."""
        return self.point.value


def multiplier_test(kind: BranchEvent, values: np.ndarray) -> float:
    """A function of the multipliers that is smooth in the Jacobian and vanishes at this kind.

    Product of λ − 1, of λ + 1, or of λᵢ λⱼ − 1 over all pairs.
    """
    if kind is BranchEvent.NEIMARK_SACKER:
        return float(np.prod([a * b - 1.0 for a, b in combinations(values, 2)]).real)
    return float(np.prod(values - _CRITICAL[kind]).real)


def critical_multiplier(kind: BranchEvent, point: BranchPoint) -> tuple[complex, float, float]:
    """The multiplier by which a gait is at this kind, its error, and its distance from there."""
    values = point.multipliers
    if kind is BranchEvent.NEIMARK_SACKER:
        pairs = np.abs(values.imag) > _REAL
        distances = np.where(pairs, np.abs(np.abs(values) - 1.0), np.inf)
    else:
        distances = np.abs(values - _CRITICAL[kind])
    nearest = int(np.argmin(distances))
    error = float(point.multiplier_errors[nearest])
    return complex(values[nearest]), error, float(distances[nearest])


def bifurcations_between(
    curve: Curve, axis: Axis, here: CurvePoint, there: CurvePoint
) -> list[tuple[CurvePoint, BifurcationPoint]]:
    """The bifurcations between two neighbouring points, in their order along the branch."""
    turns = here.tangent[-1] * there.tangent[-1] < 0.0
    found = []
    for kind in _CRITICAL:
        # Where the parameter turns back it is a fold, and told by that more exactly.
        if turns and kind is BranchEvent.BRANCH_POINT:
            continue
        test = advance if kind is BranchEvent.FOLD else partial(_test_at, kind)
        place = locate(curve, here, there, test) if test(here) * test(there) < 0.0 else None
        if place is None:
            continue
        point = branch_point(curve, axis, place)
        value, error, distance = critical_multiplier(kind, point)
        # Two real multipliers whose product is 1 cross nothing.
        if distance < _AT:
            off = _witness_shift(curve, axis, place, test)
            if kind is not BranchEvent.FOLD:
                ends = [branch_point(curve, axis, each) for each in (here, there)]
                off = _with_multiplier_errors(off, kind, point, ends)
            found.append((place, BifurcationPoint(kind, point, value, error, off)))
    return sorted(found, key=lambda each: float((each[0].place - here.place) @ here.tangent))


def explains(here: CurvePoint, there: CurvePoint, kinds: list[BranchEvent]) -> bool:
    """Whether bifurcations of these kinds make of the multipliers outside the unit circle at one
    point those at the other."""
    before, after = (
        int(np.sum(np.abs(multipliers_of(each.change)) > 1.0)) for each in (here, there)
    )
    most = sum(2 if kind is BranchEvent.NEIMARK_SACKER else 1 for kind in kinds)
    change = abs(after - before)
    return change == 0 or (change <= most and (most - change) % 2 == 0)


def not_located(point: BranchPoint, beyond: float) -> BifurcationPoint:
    """The entry of an interval in which multipliers cross, from a value to a point."""
    nearest = int(np.argmin(np.abs(np.abs(point.multipliers) - 1.0)))
    value, error = complex(point.multipliers[nearest]), float(point.multiplier_errors[nearest])
    width = abs(point.value - beyond)
    return BifurcationPoint(BranchEvent.NOT_LOCATED, point, value, error, width, beyond)


def locate_near(
    curve: Curve, place: np.ndarray, tangent: np.ndarray, test: Callable[[CurvePoint], float]
) -> CurvePoint | None:
    """Where a test function vanishes on a curve, between points on both sides of another's place.

    None where the curve is lost, or the test function has one sign at both.
    """
    for beside in _BESIDE:
        here, there = (
            correct(curve, place + way * beside * tangent, tangent).found for way in (-1.0, 1.0)
        )
        if here is not None and there is not None and test(here) * test(there) < 0.0:
            found = locate(curve, here, there, test)
            if found is not None:
                return found
    return None


def _witness_shift(
    curve: Curve, axis: Axis, place: CurvePoint, test: Callable[[CurvePoint], float]
) -> float:
    """By how much the witness of a cycle's error has a bifurcation elsewhere."""
    other = locate_near(witness_curve(curve, axis), place.place, place.tangent, test)
    if other is None:
        return float("nan")
    ends = [axis.value(float(each.place[-1])) for each in (place, other)]
    return abs(ends[0] - ends[1])


def _with_multiplier_errors(
    shift: float, kind: BranchEvent, point: BranchPoint, ends: list[BranchPoint]
) -> float:
    """Error of a value at which a multiplier is critical.

    The witness's shift may be small by chance: errors of the multiplier at the point and on both
    sides of it are carried over by its rate, and what it misses the circle by at the point.
    """
    (first, *_), (last, *_) = told = [critical_multiplier(kind, each) for each in ends]
    value, error, distance = critical_multiplier(kind, point)
    change = abs(last) - abs(first) if value.imag != 0.0 else abs(last - first)
    along = ends[1].value - ends[0].value
    if change == 0.0 or along == 0.0:
        return shift
    largest = max(error, *(each[1] for each in told))
    return float(np.nanmax([shift, abs(along / change) * largest])) + abs(along / change) * distance


def advance(found: CurvePoint) -> float:
    """How the parameter advances along the curve."""
    return float(found.tangent[-1])


def _test_at(kind: BranchEvent, found: CurvePoint) -> float:
    return multiplier_test(kind, multipliers_of(found.change))
