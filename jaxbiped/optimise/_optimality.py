"""Optimality conditions of Karush, Kuhn and Tucker at a design: residual and multipliers."""

from typing import NamedTuple

import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped.optimise._design_functions import AnyRow, cluster_rows, rows_of
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._objective_values import Evaluation

OPTIMAL = 1e-3
"""Residual of the conditions of optimality from which a design counts as an optimum."""
_NEAR = 1e-4
"""Distance in u within which other designs' derivatives count where a design has a corner."""
_AT_BOUND = 1e-6
"""Distance in u at which a variable is at its bound."""
_VANISHING = 1e-3
"""Size of a normal, as a share of the largest, below which it counts as none."""
_SURE = 1e3
"""Weight with which designs' shares add up to one, in least squares."""


class Held(NamedTuple):
    """A requirement at an optimum.

    Attributes:
        name: name of the measure, or of the variable at its bound.
        bound: the bound.
        value: its value.
        error: estimated error of the value.
        active: whether the bound holds the optimum back.
        multiplier: derivative of the objective with respect to the bound; zero if not active.
        multiplier_error: estimated error of the multiplier, from the gradients' error bars.
    """

    name: str
    bound: float
    value: float
    error: float
    active: bool
    multiplier: float
    multiplier_error: float


class Optimality(NamedTuple):
    """Distance of a design from an optimum, by the Karush–Kuhn–Tucker conditions.

    Attributes:
        residual: largest derivative of the objective that no multiplier balances, for one whole
            range between a variable's bounds, relative to the objective's own size.
        error: error of the residual that follows from the gradients' error bars.
        excess: largest violation of a requirement, relative to its bound.
        requirements, bounds: the requirements, and the bounds at which variables are.
    """

    residual: float
    error: float
    excess: float
    requirements: tuple[Held, ...]
    bounds: tuple[Held, ...]


class _Normal(NamedTuple):
    """Inward normal of an active requirement or bound, its error, and its multiplier's limit.

    `by_radius` is what the radius in the sum, where it is a variable of its own, adds to it.
    """

    gradient: np.ndarray
    error: np.ndarray
    least: float
    by_radius: float = 0.0


def smooth_weights(problem: DesignProblem) -> tuple[dict[str, float], float]:
    """Weights of the sum but for the spectral radius's, which comes behind them.

    Minimised, the radius is a variable of its own, which the conditions on its cluster bound.
    """
    weights = dict(problem.weights)
    if problem.has_cluster and weights.get("spectral_radius", 0.0) > 0.0:
        return weights, weights.pop("spectral_radius")
    return weights, 0.0


class _Balance(NamedTuple):
    """The gradient of the sum, and multipliers of what holds it (q,), in the least-squares sense.

    Attributes:
        left: what no multiplier balances, (k,), or with the radius's weight (k + 1,).
        gradient_error: its error, (k,).
        active: rows that hold it, of requirements first, then of the radius in the sum.
        normals: theirs, and those of the variables at a bound.
        multipliers: of all these.
    """

    left: np.ndarray
    gradient_error: np.ndarray
    active: list[tuple[AnyRow, bool]]
    normals: list[_Normal]
    multipliers: np.ndarray


def _smooth_gradient(problem: DesignProblem, design: Design) -> np.ndarray:
    """Of the sum but for the spectral radius's part."""
    weights, _ = smooth_weights(problem)
    return problem.gradient(design.u, problem.objective(design.known, weights).slopes)


def _balance(
    problem: DesignProblem, design: Design, others: list[Design], scale: float
) -> _Balance:
    u, known = design
    weights, of_radius = smooth_weights(problem)
    every = [design, *others]
    gradients = [_smooth_gradient(problem, each) / scale for each in every]
    error = problem.gradient(u, problem.objective(known, weights).slope_errors) / scale
    radius = known.values["spectral_radius"] if of_radius else np.inf
    rows = [(row, False) for row in rows_of(problem)]
    rows += [(row, True) for row in (cluster_rows(problem, radius) if of_radius else ())]
    pairs = [
        (row, in_sum, _of_row(problem, each, row, in_sum))
        for each in every
        for row, in_sum in rows
        if row.is_active(each.known)
    ]
    sizes = [float(np.linalg.norm([*each.gradient, each.by_radius])) for _, _, each in pairs]
    # Where multipliers pass through each other a condition's gradient vanishes, and tells nothing.
    pairs = [p for p, size in zip(pairs, sizes, strict=True) if size > _VANISHING * max(sizes)]
    active = [(row, in_sum) for row, in_sum, _ in pairs]
    normals = [each for _, _, each in pairs]
    units, zero = np.eye(len(u)), np.zeros_like(u)
    normals += [_Normal(side * units[place], zero, 0.0) for place, side in _at_bounds(u)]
    # Columns: shares of the designs, which add up to one, and the multipliers.
    columns = [np.append(each, [of_radius / scale, _SURE]) for each in gradients]
    columns += [np.append(-each.gradient, [-each.by_radius, 0.0]) for each in normals]
    matrix, right = np.stack(columns, axis=1), np.append(np.zeros(len(u) + 1), _SURE)
    limits = np.append(np.zeros(len(every)), [each.least for each in normals])
    found = scipy.optimize.lsq_linear(matrix, right, (limits, np.inf), method="bvls").x
    left = (matrix @ found)[: len(u) + bool(of_radius)]
    return _Balance(left, np.abs(error), active, normals, found[len(every) :])


def lagrangian_change(
    problem: DesignProblem, here: Design, there: Design, scale: float
) -> np.ndarray:
    """How the gradient of the scaled Lagrangian changes, with the multipliers of `there`."""
    found = _balance(problem, there, [], scale)
    ends = []
    for each in (there, here):
        own = _smooth_gradient(problem, each) / scale
        for (row, _), multiplier in zip(found.active, found.multipliers, strict=False):
            own = own - multiplier * problem.gradient(each.u, row.slopes(each.known))
        ends.append(own)
    return ends[0] - ends[1]


def optimality_of(problem: DesignProblem, design: Design) -> Optimality:
    """Multipliers that balance the gradient best, in the least-squares sense, with right signs.

    Where they leave more than `OPTIMAL`, gradients of designs within 1e-4 may have a share in it: a
    combination that balances says that no direction is better (Clarke's ε-subdifferential).
    """
    u, known = design
    scale = max(abs(problem.objective(known).value), 1e-300)
    found = _balance(problem, design, [], scale)
    if np.max(np.abs(found.left)) > OPTIMAL:
        near = [e for e in problem.asked if 0.0 < np.max(np.abs(e.u - u)) <= _NEAR]
        found = _balance(problem, design, near, scale) if near else found
    errors = np.zeros(len(found.normals))
    gradient_error = found.gradient_error
    if found.normals:
        matrix = np.stack([each.gradient for each in found.normals], axis=1)
        spreads = np.stack([each.error for each in found.normals], axis=1)
        gradient_error = gradient_error + spreads @ np.abs(found.multipliers)
        errors = np.abs(np.linalg.pinv(matrix)) @ gradient_error
    count = len(found.active)
    held: dict[tuple[str, float, float], tuple[float, float]] = {}
    for (row, in_sum), multiplier, error in zip(
        found.active, found.multipliers[:count], errors[:count], strict=True
    ):
        if not in_sum:
            size = scale * row.by_bound(known)
            total, spread = held.get(row[:3], (0.0, 0.0))
            held[row[:3]] = total - multiplier * size, spread + error * abs(size)
    rows = {row[:3]: row for row in rows_of(problem)}.values()
    at_bounds = zip(_at_bounds(u), found.multipliers[count:], errors[count:], strict=True)
    return Optimality(
        residual=float(np.max(np.abs(found.left))),
        error=float(np.max(gradient_error)),
        excess=problem.excess(known),
        requirements=tuple(_held_measure(problem, row, known, held.get(row[:3])) for row in rows),
        bounds=tuple(_held_variable(problem, u, scale, *each) for each in at_bounds),
    )


def _of_row(problem: DesignProblem, design: Design, row: AnyRow, in_sum: bool) -> _Normal:
    u, known = design
    own = problem.gradient(u, row.slopes(known))
    error = np.abs(problem.gradient(u, row.slope_errors(known)))
    least = -np.inf if row.equality else 0.0
    return _Normal(own, error, least, row.by_bound(known) if in_sum else 0.0)


def _at_bounds(u: np.ndarray) -> list[tuple[int, float]]:
    """Variables at a bound: where, and 1 for the lower, −1 for the upper."""
    lower = [(int(k), 1.0) for k in np.flatnonzero(u <= _AT_BOUND)]
    return lower + [(int(k), -1.0) for k in np.flatnonzero(u >= 1.0 - _AT_BOUND)]


def _held_measure(
    problem: DesignProblem, row: AnyRow, known: Evaluation, found: tuple[float, float] | None
) -> Held:
    """Multipliers in the units of objective and measure: of moving the bound upwards."""
    multiplier, error = found or (0.0, 0.0)
    return Held(
        name=row.name,
        bound=row.bound,
        value=known.values[row.name],
        error=known.errors[row.name],
        active=found is not None,
        multiplier=float(problem.sense * multiplier),
        multiplier_error=float(error),
    )


def _held_variable(
    problem: DesignProblem,
    u: np.ndarray,
    scale: float,
    at: tuple[int, float],
    multiplier: float,
    error: float,
) -> Held:
    (place, side), variables = at, problem.variables
    value, rate = (float(each[place]) for each in (variables.values(u), variables.rates(u)))
    scale *= problem.sense
    return Held(
        name=variables.names[place],
        bound=value,
        value=value,
        error=0.0,
        active=True,
        multiplier=float(side * multiplier * scale / rate),
        multiplier_error=float(error * abs(scale / rate)),
    )
