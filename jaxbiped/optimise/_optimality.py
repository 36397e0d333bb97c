"""Optimality conditions of Karush, Kuhn and Tucker at a design: residual and multipliers."""

from typing import NamedTuple

import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped.optimise._design_problem import Design, DesignProblem, scale_of
from jaxbiped.optimise._optimisers import Row, rows_of

_ACTIVE = 1e-4
"""Largest part of its bound by which an active requirement is missed or kept too well."""
_AT_BOUND = 1e-6
"""Distance in u at which a variable is at its bound."""


class Held(NamedTuple):
    """A requirement at an optimum.

    Attributes:
        name: of the measure, or of the variable at its bound.
        bound: that it is held to.
        value: its value.
        error: estimated error of that.
        active: whether the bound holds the optimum back.
        multiplier: derivative of the objective with respect to the bound; zero where not active.
        multiplier_error: estimated, from the gradients' error bars.
    """

    name: str
    bound: float
    value: float
    error: float
    active: bool
    multiplier: float
    multiplier_error: float


class Optimality(NamedTuple):
    """How far a design is from an optimum.

    Attributes:
        residual: largest derivative of the objective that no multiplier balances, for one whole
            range between a variable's bounds, relative to the objective's own size.
        error: what the gradients' error bars make of it.
        excess: by how much the worst requirement is missed, relative to its bound.
        requirements, bounds: what holds the optimum, or could; of the variables those at a bound.
    """

    residual: float
    error: float
    excess: float
    requirements: tuple[Held, ...]
    bounds: tuple[Held, ...]


class _Normal(NamedTuple):
    """Inward normal of an active requirement or bound, its error, and its multiplier's limits."""

    gradient: np.ndarray
    error: np.ndarray
    least: float


def optimality_of(problem: DesignProblem, design: Design) -> Optimality:
    """Multipliers that balance the gradient best, in the least-squares sense, with right signs."""
    u, known = design
    value, slopes, _ = problem.objective(known)
    scale = max(abs(value), 1e-300)
    gradient = problem.gradient(u, slopes) / scale
    spread = sum(abs(w) * known.slope_errors[name] for name, w in problem.weights.items())
    gradient_error = np.abs(problem.gradient(u, np.asarray(spread))) / scale
    rows = rows_of(problem)
    active = [row for row in rows if row.equality or row.value(known) <= _ACTIVE]
    normals = [_of_row(problem, design, row) for row in active]
    at_bound = _at_bounds(u)
    normals += [_of_bound(u, place, side) for place, side in at_bound]
    multipliers, errors = np.zeros(len(normals)), np.zeros(len(normals))
    left = gradient
    if normals:
        matrix = np.stack([each.gradient for each in normals], axis=1)
        limits = np.asarray([each.least for each in normals])
        multipliers = scipy.optimize.lsq_linear(matrix, gradient, bounds=(limits, np.inf)).x
        left = gradient - matrix @ multipliers
        spreads = np.stack([each.error for each in normals], axis=1) @ np.abs(multipliers)
        gradient_error = gradient_error + spreads
        errors = np.abs(np.linalg.pinv(matrix)) @ gradient_error
    found = {row: (m, e) for row, m, e in zip(active, multipliers, errors, strict=False)}
    at = zip(at_bound, multipliers[len(active) :], errors[len(active) :], strict=True)
    sized = problem.sense * scale
    return Optimality(
        residual=float(np.max(np.abs(left))),
        error=float(np.max(gradient_error)),
        excess=problem.excess(known),
        requirements=tuple(_held(row, design, sized, found.get(row)) for row in rows),
        bounds=tuple(_held_bound(problem, u, sized, *each) for each in at),
    )


def _of_row(problem: DesignProblem, design: Design, row: Row) -> _Normal:
    u, known = design
    error = known.slope_errors[row.name] / scale_of(row.bound)
    least = -np.inf if row.equality else 0.0
    own = problem.gradient(u, row.slopes(known))
    return _Normal(own, np.abs(problem.gradient(u, error)), least)


def _at_bounds(u: np.ndarray) -> list[tuple[int, float]]:
    """Variables at a bound: where, and 1 for the lower, −1 for the upper."""
    lower = [(int(k), 1.0) for k in np.flatnonzero(u <= _AT_BOUND)]
    return lower + [(int(k), -1.0) for k in np.flatnonzero(u >= 1.0 - _AT_BOUND)]


def _of_bound(u: np.ndarray, place: int, side: float) -> _Normal:
    unit = np.zeros_like(u)
    unit[place] = side
    return _Normal(unit, np.zeros_like(u), 0.0)


def _held(row: Row, design: Design, scale: float, found: tuple[float, float] | None) -> Held:
    """Multipliers in the units of objective and measure: of tightening the bound upwards."""
    size = scale / scale_of(row.bound)
    multiplier, error = (0.0, 0.0) if found is None else found
    known = design.known
    return Held(
        name=row.name,
        bound=row.bound,
        value=known.values[row.name],
        error=known.errors[row.name],
        active=found is not None,
        multiplier=float(row.sign * multiplier * size),
        multiplier_error=float(error * abs(size)),
    )


def _held_bound(
    problem: DesignProblem,
    u: np.ndarray,
    scale: float,
    at: tuple[int, float],
    multiplier: float,
    error: float,
) -> Held:
    (place, side), variables = at, problem.variables
    value, rate = (float(each[place]) for each in (variables.values(u), variables.rates(u)))
    return Held(
        name=variables.names[place],
        bound=value,
        value=value,
        error=0.0,
        active=True,
        multiplier=float(side * multiplier * scale / rate),
        multiplier_error=float(error * abs(scale / rate)),
    )
