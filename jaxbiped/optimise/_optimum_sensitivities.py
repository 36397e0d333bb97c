"""Sensitivities of an optimum to what is fixed: the envelope theorem, and its conditions' slopes.

What holds the optimum is taken to go on holding it. Fiacco, Introduction to Sensitivity and
Stability Analysis in Nonlinear Programming (1983), chapter 3.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._optimality import (
    SecondDerivatives,
    lagrangian_slopes,
    scale_at,
    second_derivatives_of,
)

_SURE, _LEAST = 10.0, 1e-10
"""Pull of what holds a design in units of the derivatives that are left, and least size of these,
from which it surely holds."""


class Sensitivities(NamedTuple):
    """Derivatives of an optimum with respect to n numbers that are fixed; NaN if not known.

    Attributes:
        parameters: names of the parameters that are not varied, and "bound of NAME" for each
            measure whose bound holds the optimum.
        objective: derivatives of the objective, shape (n,), SI units.
        objective_errors: their estimated errors.
        variables: derivatives of each varied parameter, by its name, shape (n,).
        variable_errors: their estimated errors.
        measures: derivatives of each measure, by its name, shape (n,).
        measure_errors: their estimated errors.
        message: why they are not known; empty if they are.
    """

    parameters: tuple[str, ...]
    objective: np.ndarray
    objective_errors: np.ndarray
    variables: dict[str, np.ndarray]
    variable_errors: dict[str, np.ndarray]
    measures: dict[str, np.ndarray]
    measure_errors: dict[str, np.ndarray]
    message: str = ""


class OptimalityEquations(NamedTuple):
    """The k equations that determine a design, with derivatives by u and n fixed numbers.

    They are the conditions along the directions that nothing holds, requirements that hold the
    design, and variables at their bounds.

    Attributes:
        names: of the fixed numbers.
        values: what is left of the equations, shape (k,).
        by_variables: derivatives with respect to u, shape (k, k); `variable_errors` their errors.
        by_fixed: derivatives with respect to the fixed numbers, shape (k, n).
        fixed_errors: their errors.
        objective: derivatives of the scaled Lagrangian with respect to these, shape (n,).
        objective_errors: their errors.
    """

    names: tuple[str, ...]
    values: np.ndarray
    by_variables: np.ndarray
    variable_errors: np.ndarray
    by_fixed: np.ndarray
    fixed_errors: np.ndarray
    objective: np.ndarray
    objective_errors: np.ndarray


def optimality_equations(
    problem: DesignProblem, design: Design, second: SecondDerivatives
) -> OptimalityEquations:
    """The equations of a design without a doubt, see `doubt_of_derivatives`."""
    balance, (u, known), variables = second.balance, design, problem.variables
    others = variables.fixed_places
    (d, both), k, n, q = second.slopes.shape, len(u), len(others), len(balance.active)
    held = np.flatnonzero(balance.holds[:q])
    rows, r = [balance.active[place][0] for place in held], len(held)
    none = np.zeros((0, both - k))
    slopes = np.vstack([none, *(row.slopes(known) for row in rows)])
    bars = np.abs(np.vstack([none, *(row.slope_errors(known) for row in rows)]))
    by_bound = np.diag([row.by_bound(known) for row in rows])
    by_fixed, fixed_errors, variable_errors = (np.zeros((k, size)) for size in (n + r, n + r, k))
    by_fixed[:d, :n], fixed_errors[:d, :n] = (
        part[:, k:][:, others] for part in (second.slopes, second.errors)
    )
    by_fixed[d : d + r] = np.hstack([slopes[:, others], by_bound])
    fixed_errors[d : d + r, :n] = bars[:, others]
    variable_errors[:d] = second.errors[:, :k]
    variable_errors[d : d + r] = problem.gradient(u, bars)
    values = np.zeros(k)
    values[:d] = second.directions.T @ balance.left
    values[d : d + r] = [row.value(known) for row in rows]
    total, errors = lagrangian_slopes(problem, balance, scale_at(problem, design), design)
    errors = np.append(errors[others], np.zeros(r))
    errors += balance.spreads[held] @ np.abs(by_fixed[d : d + r])
    return OptimalityEquations(
        (*variables.fixed, *(f"bound of {row.name}" for row in rows)),
        values,
        np.vstack([second.slopes[:, :k], balance.normals[:, balance.holds].T]),
        variable_errors,
        by_fixed,
        fixed_errors,
        np.append(total[others], -balance.multipliers[held] @ by_bound),
        errors,
    )


def sensitivities_of(
    problem: DesignProblem, design: Design, names: Iterable[str], doubt: str = ""
) -> Sensitivities:
    """Sensitivities of a design, and of the measures with these names, unless there is a doubt."""
    names, variables, known = tuple(names), problem.variables, design.known
    second = None if doubt else second_derivatives_of(problem, design)
    doubt = doubt or doubt_of_derivatives(second)
    if second is None or doubt:
        return _unknown(problem, names, doubt)
    equations, scale = optimality_equations(problem, design, second), scale_at(problem, design)
    inverse = np.linalg.inv(equations.by_variables)
    moves = -inverse @ equations.by_fixed
    errors = equations.variable_errors @ np.abs(moves) + equations.fixed_errors
    spreads = np.abs(inverse) @ errors
    # To first order the optimum lies where the derivatives that are left vanish.
    drift = second.balance.left @ moves
    rates, measures, measure_errors = variables.rates(design.u)[:, None], {}, {}
    for name in names:
        slopes, bars = (np.zeros(len(equations.names)) for _ in range(2))
        others = variables.fixed_places
        slopes[: len(others)] = known.slopes[name][others]
        bars[: len(others)] = known.slope_errors[name][others]
        by_u = problem.gradient(design.u, np.array([known.slopes[name], known.slope_errors[name]]))
        measures[name] = slopes + by_u[0] @ moves
        measure_errors[name] = bars + np.abs(by_u[0]) @ spreads + np.abs(by_u[1]) @ np.abs(moves)
    return Sensitivities(
        equations.names,
        problem.sense * scale * (equations.objective + drift),
        scale
        * (equations.objective_errors + np.abs(drift) + second.balance.errors @ np.abs(moves)),
        dict(zip(variables.names, rates * moves, strict=True)),
        dict(zip(variables.names, rates * spreads, strict=True)),
        measures,
        measure_errors,
    )


def doubt_of_derivatives(second: SecondDerivatives | None) -> str:
    """Why an optimum has no derivatives; empty where it has."""
    if second is None:
        return "Multipliers of the gait hold the optimum, beside which it is not smooth."
    balance, rows = second.balance, [row for row, _ in second.balance.active]
    # Multipliers are no surer than the balance is, and equalities have any.
    pulls = np.abs(balance.multipliers) * np.linalg.norm(balance.normals, axis=0)
    holds = balance.holds & (pulls > _SURE * np.max(np.abs(balance.left), initial=_LEAST))
    holds[: len(rows)] |= np.array([row.equality for row in rows], bool)
    names = [row.name for row in rows] + ["a variable's bound"] * (len(holds) - len(rows))
    for name, is_held in zip(names, holds, strict=True):
        if not is_held:
            return f"It is not certain that {name} holds the optimum: its derivatives may jump."
    k, d = second.directions.shape
    if d + len(holds) != k:
        return "What holds the optimum depends on each other, so it has no derivatives."
    values, error = second.curvature
    if not np.all(np.isfinite(values)):
        return "A design beside the optimum has no gait, so it has no second derivatives."
    if np.min(values, initial=np.inf) <= error:
        least = f"{values[0]:.1e} ± {error:.1e}"
        return f"The objective's least curvature, {least}, does not determine the optimum."
    return ""


def _unknown(problem: DesignProblem, names: tuple[str, ...], message: str) -> Sensitivities:
    parameters = problem.variables.fixed
    none = np.full(len(parameters), np.nan)
    variables, measures = (dict.fromkeys(each, none) for each in (problem.variables.names, names))
    return Sensitivities(parameters, none, none, variables, variables, measures, measures, message)
