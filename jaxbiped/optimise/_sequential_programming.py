"""Sequential quadratic programming with second derivatives, for equations that nearly fix a point.

A step is Newton's onto the equations and, along them, the best one by a quadratic model that is
made convex there; Nocedal and Wright, Numerical Optimization (2006), sections 16.2 and 18.3. A
filter accepts it: Fletcher and Leyffer, Math. Programming 91 (2002), with the conditions of Wächter
and Biegler, SIAM J. Optim. 16 (2005).
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped.optimise._optimisers import RunEnding

_RANK, _CONVEX = 1e-10, 1e-9
"""Shares of the largest pivot, below which an equation counts as none, and of the largest
curvature, to which smaller ones are raised."""
_SHARES = (*(0.5**k for k in range(8)), 0.0)
"""Shares of the way onto the equations that are tried, until bounds allow one."""
_SHORTEST = 2.0**-12
"""Least share of a step that is tried."""
_SUFFICIENT, _MARGIN = 1e-4, 1e-5
"""Share of an expected gain that must come, and of a violation by which a point must be better."""
_FARTHER, _FARTHEST = 4.0, 0.1
"""Factor by which a step may add to a violation, and violation up to which any step may."""
_RESTORED = 0.99
"""Share of a violation that a step onto the equations alone may leave at most."""
_KEPT, _GAIN, _NOISE = 1e-9, 1e-10, 1e-7
"""Violation that counts as none; expected gain, as a share of the objective, from which a point
counts as best, and one that may be lost in errors of the motion."""
_VANISHING = 1e-6
"""Share of the largest objective so far below which one counts as of that size."""
_AT_BOUND = 1e-11
"""Distance of a bound that counts as none."""
_MOVED = 1e-9
"""Norm of a row that no step along the equations moves, and what is left where rows contradict."""


class Conditions(NamedTuple):
    """A problem at one point z, shape (n,), its functions of the order of one.

    Attributes:
        objective, gradient: what is minimised, (), (n,).
        equal, equal_slopes: what must be zero, (q,), (q, n).
        spare, spare_slopes: what must be at least zero, (r,), (r, n).
    """

    objective: float
    gradient: np.ndarray
    equal: np.ndarray
    equal_slopes: np.ndarray
    spare: np.ndarray
    spare_slopes: np.ndarray

    @property
    def violation(self) -> float:
        """By how much all that must hold is missed."""
        return float(np.sum(np.abs(self.equal)) - np.sum(np.minimum(self.spare, 0.0)))


class Program(Protocol):
    """A problem within bounds, each of the shape (n,)."""

    least: np.ndarray
    most: np.ndarray

    def at(self, z: np.ndarray) -> Conditions:
        """The problem at a point; not finite where it has none."""

    def curvature(self, z: np.ndarray, of_equal: np.ndarray, of_spare: np.ndarray) -> np.ndarray:
        """Second derivatives of the objective less multipliers times conditions, shape (n, n)."""


class Step(NamedTuple):
    """A step, the multipliers of the equations and of what is spare, and the gain by the model."""

    step: np.ndarray
    of_equal: np.ndarray
    of_spare: np.ndarray
    gain: float


def run_newton(
    program: Program, z: np.ndarray, iterations: int, report: Callable[[np.ndarray], None]
) -> tuple[np.ndarray, RunEnding]:
    """Steps from a point until none is expected to be better."""
    z = within(program, z)
    here, passed = program.at(z), list[tuple[float, float]]()
    if not np.isfinite(here.violation):
        return z, RunEnding(False, "The motion is lost within a segment of the first cycle.")
    of_equal, of_spare = np.zeros_like(here.equal), np.zeros_like(here.spare)
    largest = 0.0
    for _ in range(iterations):
        curvature = program.curvature(z, of_equal, of_spare)
        step, of_equal, of_spare, gain = best_step(program, z, here, curvature)
        largest = max(largest, abs(here.objective))
        size = max(abs(here.objective), _VANISHING * largest)
        if here.violation <= _KEPT and gain <= _GAIN * size:
            return z, RunEnding(True, "No better cycle is expected nearby.")
        better = _along(program, z, here, step, passed)
        if better is None and here.violation > _KEPT:
            # Nothing but the equations, and the filter begins again.
            flat, passed = here._replace(gradient=np.zeros_like(z)), []
            onto = nearest_step(program, z, here)
            better = _along(program, z, flat, onto, [(_RESTORED * here.violation, -np.inf)])
        if better is None:
            ends = here.violation <= 10.0 * _KEPT and gain <= _NOISE * size
            return z, RunEnding(ends, "No better cycle was found nearby.")
        z, here = better
        report(z)
    return z, RunEnding(False, "Iteration limit reached.")


def best_step(program: Program, z: np.ndarray, here: Conditions, curvature: np.ndarray) -> Step:
    """The quadratic model's best step; it goes onto the equations as far as bounds allow."""
    columns, triangle, order = scipy.linalg.qr(here.equal_slopes.T, pivoting=True)
    pivots = np.abs(np.diag(triangle))
    rank = int(np.sum(pivots > _RANK * pivots[0]))
    onto, along, triangle, order = (
        columns[:, :rank], columns[:, rank:], triangle[:rank, :rank], order[:rank]
    )  # fmt: skip
    newton = onto @ scipy.linalg.solve_triangular(triangle.T, -here.equal[order], lower=True)
    bends, axes = np.linalg.eigh(along.T @ curvature @ along)
    bends = np.abs(bends)
    basis = along @ (axes / np.sqrt(np.maximum(bends, _CONVEX * np.max(bends, initial=1e-300))))
    low, high, one = np.isfinite(program.least), np.isfinite(program.most), np.eye(len(z))
    rows = np.vstack([here.spare_slopes, one[low], -one[high]])
    spare = np.concatenate([here.spare, (z - program.least)[low], (program.most - z)[high]])
    matrix = rows @ basis
    for share in _SHARES:
        descent = basis.T @ (here.gradient + share * curvature @ newton)
        needed = np.where(spare < 0.0, -share, -1.0) * spare - share * rows @ newton
        moved, multipliers = least_distance(matrix, needed + matrix @ descent)
        if moved is not None:
            break
    else:
        moved = descent
    step = share * newton + basis @ (moved - descent)
    left = here.gradient + curvature @ step - multipliers @ rows
    of_equal = np.zeros(len(here.equal))
    of_equal[order] = scipy.linalg.solve_triangular(triangle, onto.T @ left)
    gain = abs(float(here.gradient @ step + 0.5 * step @ curvature @ step))
    return Step(step, of_equal, multipliers[: len(here.spare)], gain)


def nearest_step(program: Program, z: np.ndarray, here: Conditions) -> np.ndarray:
    """The step within bounds that leaves least of what is missed, in the least-squares sense."""
    missed = here.spare < 0.0
    rows = np.vstack([here.equal_slopes, here.spare_slopes[missed]])
    values = np.concatenate([here.equal, here.spare[missed]])
    # Bounds must be apart, and the step lie between them.
    low, high = program.least - z - _AT_BOUND, program.most - z + _AT_BOUND
    return np.asarray(scipy.optimize.lsq_linear(rows, -values, (low, high)).x)


def within(program: Program, z: np.ndarray) -> np.ndarray:
    """The point moved into the bounds, and onto those that it misses by rounding."""
    inside = np.where(z - program.least < _AT_BOUND, program.least, z)
    return np.where(program.most - z < _AT_BOUND, program.most, inside)


def least_distance(matrix: np.ndarray, right: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """The shortest x with matrix x ≥ right, None for none, and the multipliers of the rows.

    Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23.
    """
    sizes, multipliers = np.linalg.norm(matrix, axis=1), np.zeros(len(right))
    moves = sizes > _MOVED
    if not np.any(moves) and np.all(right <= _MOVED):
        return np.zeros(matrix.shape[1]), multipliers
    aim = np.append(np.zeros(matrix.shape[1]), 1.0)
    both = np.vstack([matrix[moves].T, right[moves]]) / sizes[moves]
    try:
        weights, left = scipy.optimize.nnls(both, aim)
    except RuntimeError:
        return None, multipliers
    rest = both @ weights - aim
    if left <= _MOVED or rest[-1] >= 0.0 or np.any(right[~moves] > _MOVED):
        return None, multipliers
    multipliers[moves] = weights / sizes[moves] / -rest[-1]
    return rest[:-1] / -rest[-1], multipliers


def _along(
    program: Program,
    z: np.ndarray,
    here: Conditions,
    step: np.ndarray,
    passed: list[tuple[float, float]],
) -> tuple[np.ndarray, Conditions] | None:
    """A point along a step that the filter accepts, which may grow by this one; None for none."""
    slope, share = float(here.gradient @ step), 1.0
    while share >= _SHORTEST:
        there = within(program, z + share * step)
        point = program.at(there)
        if _accepts(here, point, share * slope, passed):
            return there, point
        if share == 1.0 and np.isfinite(point.violation):
            # Equations bend: once more onto them, with the same derivatives.
            back = np.linalg.lstsq(here.equal_slopes, -point.equal)[0]
            there = within(program, there + back)
            point = program.at(there)
            if _accepts(here, point, slope, passed):
                return there, point
        share *= 0.5
    return None


def _accepts(
    here: Conditions, point: Conditions, slope: float, passed: list[tuple[float, float]]
) -> bool:
    """Whether a point is better in its objective or in what it misses than this one and those
    `passed`; the objective was to change by `slope`.
    """
    missed, value, before = point.violation, point.objective, here.violation
    if not np.isfinite(missed + value) or missed > max(_FARTHER * before, _FARTHEST):
        return False
    size = max(abs(here.objective), 1e-300)
    for others, theirs in (*passed, (before, here.objective)):
        if missed > (1.0 - _MARGIN) * others and value > theirs - _MARGIN * others * size:
            return False
    if slope < 0.0 and (-slope / size) ** 2.3 > before**1.1:
        return bool(value <= here.objective + _SUFFICIENT * slope)
    passed.append((before, here.objective))
    return True
