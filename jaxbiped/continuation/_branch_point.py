"""Point of a branch: a gait at a place of the parameter's axis, and what decides its stability."""

from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_positive
from jaxbiped.continuation._cycle import Cycle
from jaxbiped.gait._orbit_derivatives import CLOSENESS
from jaxbiped.gait._pseudo_arclength import Change, Curve, CurvePoint
from jaxbiped.gait._stability import critical_bifurcation, eigenvalue_errors
from jaxbiped.scene._parameter_access import (
    parameter_names,
    parameter_values,
    select_parameters,
    with_parameters,
)
from jaxbiped.scene._scene import AbstractScene

_DECADES = 100.0
"""Ratio of the ends of a range from which it is gone through by equal factors."""
_LOCATED = 1e-9
"""Error of a multiplier at least: so near to the unit circle bifurcations are located."""


class Axis(NamedTuple):
    """A parameter and the range in which it is followed.

    Attributes:
        name: name of the parameter (see `parameter_names`).
        first, last: ends of the range, SI units; s is 0 at the first and 1 at the last.
        log: whether equal steps in s are equal factors.
        leaf: position of the parameter among the scene's leaves.
    """

    name: str
    first: float
    last: float
    log: bool
    leaf: int

    def value(self, s: float) -> float:
        """The parameter at s."""
        if self.log:
            return float(self.first * (self.last / self.first) ** s)
        return float(self.first + s * (self.last - self.first))

    def slope(self, s: float) -> float:
        """Its derivative with respect to s."""
        if self.log:
            return self.value(s) * float(np.log(self.last / self.first))
        return self.last - self.first

    def place(self, value: float) -> float:
        """The s at a value of the parameter."""
        if self.log:
            return float(np.log(value / self.first) / np.log(self.last / self.first))
        return (value - self.first) / (self.last - self.first)


def axis_of(
    scene: AbstractScene, along: str, bounds: tuple[float, float], log: bool | None
) -> Axis:
    """The axis of a scene's parameter; raises `ArgumentError` for what is not allowed."""
    check_choice("along", along, parameter_names(scene))
    if np.shape(bounds) != (2,):
        raise ArgumentError(f"bounds = {bounds!r} is not allowed: give two numbers, (from, to).")
    for name, value in zip(("bounds[0]", "bounds[1]"), bounds, strict=True):
        check_finite(name, value)
        with_parameters(scene, {along: value})
    low, high = sorted(map(float, bounds))
    if low == high:
        raise ArgumentError(f"bounds = {bounds!r} is not allowed: the range is empty.")
    if log:
        check_positive("bounds[0]", low)
    by_factors = low > 0.0 and high >= _DECADES * low if log is None else log
    _, (leaf,) = select_parameters(scene, (along,))
    return Axis(along, low, high, by_factors, leaf)


def start_of(scene: AbstractScene, axis: Axis) -> float:
    """The scene's own value of the axis's parameter, or the nearest in its range."""
    return float(np.clip(float(parameter_values(scene)[axis.name]), axis.first, axis.last))


class CycleFootsteps(NamedTuple):
    """The k footsteps of a cycle one by one, from section to section (strides of unequal legs).

    Attributes:
        recurring: the m components with which each footstep begins, shape (k, m).
        period: duration of each footstep [s], shape (k,).
        step_length: distance from the foot that stands to the one that strikes [m], shape (k,).
        peak_normal: largest normal force on a foot in each footstep [N], shape (k,).
    """

    recurring: np.ndarray
    period: np.ndarray
    step_length: np.ndarray
    peak_normal: np.ndarray


class BranchPoint(NamedTuple):
    """A gait on a branch. The state has m components besides those that are cyclic, as hip_x.

    Attributes:
        value: value of the parameter, SI units.
        recurring: the m components, shape (m,).
        period: duration of the cycle [s].
        step_length: advance along the slope in the cycle [m], or of a hybrid system's first cyclic
            coordinate; NaN if it has none.
        peak_normal: largest normal force on a foot [N]; 0 for a hybrid system.
        multipliers: Floquet multipliers, largest first, without the trivial one, shape (m − 1,).
        multiplier_errors: estimated errors of the multipliers, shape (m − 1,); infinite if the gait
            grazes a switch.
        unit_multiplier_error: distance from 1 of the multiplier that must be 1.
        bifurcation: code of a `Bifurcation`: whether one lies within its error of the unit circle.
        residual: largest change of a component over the cycle, SI units.
        place, tangent: point and tangent of the curve of gaits, scaled by the sizes of the
            components and the range, shape (m + 1,).
        footsteps: the footsteps of a cycle of several; None for a single one, whose values are
            those of the cycle.
    """

    value: float
    recurring: np.ndarray
    period: float
    step_length: float
    peak_normal: float
    multipliers: np.ndarray
    multiplier_errors: np.ndarray
    unit_multiplier_error: float
    bifurcation: int
    residual: float
    place: np.ndarray
    tangent: np.ndarray
    footsteps: CycleFootsteps | None = None

    @property
    def stable(self) -> bool | None:
        """Whether all multipliers lie inside the unit circle; None where their errors leave it
        open."""
        return is_stable(self.multipliers, self.multiplier_errors)


def is_stable(multipliers: np.ndarray, errors: np.ndarray) -> bool | None:
    """Whether multipliers lie inside the unit circle; None where an error bar straddles it."""
    sizes, errors = np.abs(multipliers), np.maximum(errors, _LOCATED)
    if np.any(sizes - errors > 1.0):
        return False
    return True if np.all(sizes + errors < 1.0) else None


def witness_curve(curve: Curve, axis: Axis) -> Curve:
    """The same gaits as the witness of each cycle's error has them."""

    def change(point: np.ndarray, s: float) -> Change:
        seen: Cycle = curve.change(point, s).seen
        return change_of(Cycle(*(leaf[::-1] for leaf in seen)), point, axis.slope(s))

    return curve._replace(change=change)


def change_of(seen: Cycle, point: np.ndarray, slope: float) -> Change:
    """What a cycle changes in the point that it began at."""
    m, jacobian = len(point), np.asarray(seen.jacobian[0])
    return Change(
        value=np.asarray(seen.recurring[0]) - point,
        by_point=jacobian[:, :m] - np.eye(m),
        by_s=jacobian[:, m] * slope,
        code=seen.failure,
        seen=seen,
    )


def branch_point(curve: Curve, axis: Axis, found: CurvePoint) -> BranchPoint:
    cycle: Cycle = found.change.seen
    m = len(found.place) - 1
    jacobian, looser = np.asarray(cycle.jacobian)[:, :, :m]
    system = _leading_eigensystem(jacobian)
    values = system[0]
    errors = np.asarray(eigenvalue_errors(system, looser - jacobian, np.linalg.eigvals(looser)))
    return BranchPoint(
        value=axis.value(float(found.place[-1])),
        recurring=found.place[:-1] * curve.sizes[:-1],
        period=float(cycle.period[0]),
        step_length=float(cycle.advance[0]),
        peak_normal=float(cycle.peak[0]),
        multipliers=values,
        multiplier_errors=np.where(cycle.grazes[0] > 0, np.inf, errors),
        unit_multiplier_error=_unit_error(cycle),
        bifurcation=int(critical_bifurcation(values, errors, CLOSENESS)),
        residual=float(np.max(np.abs(found.change.value))),
        place=found.place,
        tangent=found.tangent,
    )


def multipliers_of(change: Change) -> np.ndarray:
    """Floquet multipliers from the derivative on the section, shape (m − 1,).

    Not from that at a fixed time: there the trivial one is 1 instead of 0, and at a fold, where
    another comes to 1, both have the square root of the derivative's error.
    """
    jacobian = np.asarray(change.seen.jacobian[0])
    return _leading_eigensystem(jacobian[:, : len(jacobian)])[0]


def _leading_eigensystem(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All but the smallest eigenvalue, largest first, with right and left eigenvectors."""
    import scipy.linalg

    values, left, right = scipy.linalg.eig(matrix, left=True)
    order = np.argsort(-np.abs(values), kind="stable")[:-1]
    left = np.conj(left[:, order]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        left = left / np.sum(left.T * right[:, order], axis=0)[:, None]
    return values[order], right[:, order], left


def _unit_error(cycle: Cycle) -> float:
    """Distance from 1 of the multiplier whose eigenvector is the velocity."""
    values, vectors = np.linalg.eig(np.asarray(cycle.monodromy[0]))
    parts = np.linalg.lstsq(vectors, np.asarray(cycle.velocity[0], complex))[0]
    return float(abs(values[np.argmax(np.abs(parts))] - 1.0))
