"""Bifurcations on a branch: where multipliers cross the unit circle, located between its points.

Test functions that change sign there: Kuznetsov, Elements of Applied Bifurcation Theory (2004),
section 10.2.2.
"""

import enum
from itertools import combinations
from typing import NamedTuple

import numpy as np

from jaxbiped.continuation._axis import Axis
from jaxbiped.continuation._branch_point import BranchPoint, branch_point, multipliers_of
from jaxbiped.gait._pseudo_arclength import Curve, CurvePoint, locate

_REAL = 1e-9
"""Imaginary part up to which a multiplier counts as real."""
_AT = 1e-3
"""Distance from the unit circle that a located multiplier may have."""


class BranchEvent(enum.StrEnum):
    """What happens at a special point of a branch.

    - fold: a multiplier at +1; two branches meet, and the parameter turns back.
    - period-doubling: one at −1; gaits of twice the footsteps branch off.
    - neimark-sacker: a complex pair on the unit circle.
    - branch-point: one at +1 where the parameter does not turn back: branches cross.
    - limit: the branch ends by a limit of the model (see `LimitCause`).
    """

    FOLD = "fold"
    PERIOD_DOUBLING = "period-doubling"
    NEIMARK_SACKER = "neimark-sacker"
    BRANCH_POINT = "branch-point"
    LIMIT = "limit"


class BifurcationPoint(NamedTuple):
    """A special point of a branch.

    Attributes:
        kind: what happens there.
        point: the gait there; at a limit the last before it.
        multiplier: the critical multiplier; at a limit the largest.
        error: its estimated error.
    """

    kind: BranchEvent
    point: BranchPoint
    multiplier: complex
    error: float

    @property
    def value(self) -> float:
        """Of the parameter, SI units."""
        return self.point.value


def fold_test(found: CurvePoint) -> float:
    """How the parameter advances along the curve."""
    return float(found.tangent[-1])


def doubling_test(found: CurvePoint) -> float:
    """Product of (λ + 1)."""
    return float(np.prod(_multipliers(found) + 1.0).real)


def branching_test(found: CurvePoint) -> float:
    """Product of (λ − 1)."""
    return float(np.prod(_multipliers(found) - 1.0).real)


def pair_test(found: CurvePoint) -> float:
    """Product of (λᵢ λⱼ − 1) over pairs."""
    pairs = combinations(_multipliers(found), 2)
    return float(np.prod([a * b - 1.0 for a, b in pairs]).real)


def _multipliers(found: CurvePoint) -> np.ndarray:
    return multipliers_of(found.change)


_TESTS = {
    BranchEvent.FOLD: fold_test,
    BranchEvent.PERIOD_DOUBLING: doubling_test,
    BranchEvent.NEIMARK_SACKER: pair_test,
    BranchEvent.BRANCH_POINT: branching_test,
}


def bifurcations_between(
    curve: Curve, axis: Axis, here: CurvePoint, there: CurvePoint
) -> list[tuple[CurvePoint, BifurcationPoint]]:
    """The bifurcations between two neighbouring points, in their order along the branch."""
    turns = fold_test(here) * fold_test(there) < 0.0
    found = []
    for kind, test in _TESTS.items():
        if test(here) * test(there) >= 0.0 or (kind is BranchEvent.BRANCH_POINT and turns):
            continue
        place = locate(curve, here, there, test)
        if place is None:
            continue
        event = _event(kind, branch_point(curve, axis, place))
        if event is not None:
            found.append((place, event))
    return sorted(found, key=lambda each: float((each[0].place - here.place) @ here.tangent))


def _event(kind: BranchEvent, point: BranchPoint) -> BifurcationPoint | None:
    """The event at a zero of a test function; None where it is none of this kind."""
    values = point.multipliers
    complex_ones = np.abs(values.imag) > _REAL
    if kind is BranchEvent.NEIMARK_SACKER:
        distances = np.where(complex_ones, np.abs(np.abs(values) - 1.0), np.inf)
    else:
        critical = -1.0 if kind is BranchEvent.PERIOD_DOUBLING else 1.0
        distances = np.abs(values - critical)
    nearest = int(np.argmin(distances))
    # A pair of real multipliers whose product is 1 crosses nothing.
    if not distances[nearest] < _AT:
        return None
    error = float(point.multiplier_errors[nearest])
    return BifurcationPoint(kind, point, complex(values[nearest]), error)
