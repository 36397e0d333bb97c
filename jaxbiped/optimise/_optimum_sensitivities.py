"""Sensitivities of an optimum to what is fixed: the envelope theorem, and its conditions' slopes.

What holds the optimum is taken to go on holding it. Fiacco, Introduction to Sensitivity and
Stability Analysis in Nonlinear Programming (1983), chapter 3.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from jaxbiped.optimise._design_functions import rows_of
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._optimality import (
    SecondDerivatives,
    lagrangian_slopes,
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


def sensitivities_of(
    problem: DesignProblem, design: Design, names: Iterable[str], doubt: str = ""
) -> Sensitivities:
    """Sensitivities of a design, and of the measures with these names, unless there is a doubt."""
    (u, known), variables, sense = design, problem.variables, problem.sense
    second = None if doubt else second_derivatives_of(problem, design)
    doubt = doubt or _doubt_of(second)
    if second is None or doubt:
        none = np.full(len(variables.fixed), np.nan)
        by_name = [dict.fromkeys(each, none) for each in (variables.names, names)]
        unknown = by_name[0], by_name[0], by_name[1], by_name[1]
        return Sensitivities(variables.fixed, none, none, *unknown, doubt)
    balance, scale = second.balance, second.scale
    rows, k, d = [row for row, _ in balance.active], len(u), len(second.slopes)
    r, n = len(rows), len(variables.fixed)

    def fixed(slopes: np.ndarray) -> np.ndarray:
        """Derivatives with respect to what is fixed, at first none with respect to bounds."""
        chosen = slopes[..., variables.fixed_places]
        return np.concatenate([chosen, np.zeros((*chosen.shape[:-1], r))], axis=-1)

    none = np.zeros((k - d, second.slopes.shape[1] - k))  # of variables at their bounds
    slopes, bars = none.copy(), none.copy()
    by_bound = np.zeros((k - d, n + r))
    for i, row in enumerate(rows):
        slopes[i], bars[i] = row.slopes(known), np.abs(row.slope_errors(known))
        by_bound[i, n + i] = row.by_bound(known)
    held_by_fixed = fixed(slopes) + by_bound
    inverse = np.linalg.inv(np.vstack([second.slopes[:, :k], balance.normals.T]))
    moves = -inverse @ np.vstack([fixed(second.slopes[:, k:]), held_by_fixed])
    errors = np.vstack([second.errors[:, :k], problem.gradient(u, bars)]) @ np.abs(moves)
    errors += np.vstack([fixed(second.errors[:, k:]), fixed(bars)])
    spreads = np.abs(inverse) @ errors
    total, off = fixed(lagrangian_slopes(problem, balance, scale, design))
    # To first order the optimum lies where the derivatives that are left vanish.
    drift = balance.left @ moves
    total = total - balance.multipliers @ by_bound + drift
    off = off + balance.spreads @ np.abs(held_by_fixed)
    off += np.abs(drift) + balance.errors @ np.abs(moves)
    measures, measure_errors = {}, {}
    for name in names:
        both = np.array([known.slopes[name], known.slope_errors[name]])
        (by_u, by_u_error), (own, own_error) = problem.gradient(u, both), fixed(both)
        measures[name] = own + by_u @ moves
        measure_errors[name] = own_error + np.abs(by_u) @ spreads + by_u_error @ np.abs(moves)
    rates = variables.rates(u)[:, None]
    by_variable, variable_errors = (
        dict(zip(variables.names, rates * each, strict=True)) for each in (moves, spreads)
    )
    parameters = (*variables.fixed, *(f"bound of {row.name}" for row in rows))
    objective = sense * scale * total, scale * off
    return Sensitivities(
        parameters, *objective, by_variable, variable_errors, measures, measure_errors
    )


def newton_step(problem: DesignProblem, design: Design, second: SecondDerivatives) -> np.ndarray:
    """The step in u to where the conditions of optimality hold, by second derivatives of another.

    What holds the other optimum is to hold this one, too.
    """
    (u, known), balance, k = design, second.balance, len(design.u)
    names = [(row.name, row.sign) for row, _ in balance.active]
    rows = [row for row in rows_of(problem) if (row.name, row.sign) in names]
    slopes = [problem.gradient(u, row.slopes(known)) for row in rows]
    normals = np.vstack([*slopes, balance.normals[:, len(names) :].T])
    gradient = problem.gradient(u, problem.objective(known).slopes) / second.scale
    left = gradient - normals.T @ np.linalg.lstsq(normals.T, gradient)[0]
    missed = np.zeros(len(normals))
    missed[: len(rows)] = [row.value(known) for row in rows]
    matrix = np.vstack([second.slopes[:, :k], normals])
    values = np.concatenate([second.directions.T @ left, missed])
    return -np.linalg.lstsq(matrix, values)[0]


def _doubt_of(second: SecondDerivatives | None) -> str:
    """Why an optimum has no derivatives; empty where it has."""
    if second is None:
        return "Multipliers of the gait hold the optimum, beside which it is not smooth."
    balance, rows = second.balance, [row for row, _ in second.balance.active]
    # Multipliers are no surer than the balance is; equalities may have any.
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
