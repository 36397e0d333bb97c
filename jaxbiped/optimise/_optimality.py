"""Optimality conditions of Karush, Kuhn and Tucker at a design: residual and multipliers."""

import functools
from typing import NamedTuple

import numpy as np
import scipy  # its submodules are imported where they are first used

from jaxbiped.optimise._design_functions import AnyRow, Row, cluster_rows, rows_of
from jaxbiped.optimise._design_problem import Design, DesignProblem, scale_of

OPTIMAL = 1e-3
"""Residual of the conditions of optimality from which a design counts as an optimum."""
_NEAR, _BEND = (1e-5, 2e-2), 0.1
"""Distances in u of designs whose differences the derivatives must explain, and what of the change
of the derivatives between them these may miss."""
_NEARER = (0.05, 0.0025)
"""Shares of the way to another design at one of which derivatives must explain the difference that
did not explain the whole one."""
_AT_BOUND = 1e-6
"""Distance in u at which a variable is at its bound."""
_ASIDE = 1e-3
"""How far beside a design, in u, gradients are compared for its curvature."""
_VANISHING = 1e-3
"""Size of a normal, as a share of the largest, below which it counts as none."""
_FLAT = 1e-6
"""Derivative of the objective, as a share of its size, that counts as none beside its error."""


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


def smooth_weights(problem: DesignProblem) -> tuple[dict[str, float], float]:
    """Weights of the sum but for the spectral radius's, which comes behind them.

    Minimised, the radius is a variable of its own, which the conditions on its cluster bound.
    """
    weights = dict(problem.weights)
    if problem.has_cluster and weights.get("spectral_radius", 0.0) > 0.0:
        return weights, weights.pop("spectral_radius")
    return weights, 0.0


class Balance(NamedTuple):
    """The gradient of the sum, and multipliers of what holds it (q,), in the least-squares sense.

    Attributes:
        left: what no multiplier balances, (k,), or with the radius's weight (k + 1,).
        errors: of that, from all error bars, of its shape.
        active: rows that hold it, of requirements first, then of the radius in the sum.
        multipliers, spreads: of these, then of the variables at a bound; and their errors.
        normals: gradients of all these, (k, q), or (k + 1, q).
    """

    left: np.ndarray
    errors: np.ndarray
    active: list[tuple[AnyRow, bool]]
    multipliers: np.ndarray
    spreads: np.ndarray
    normals: np.ndarray

    @property
    def holds(self) -> np.ndarray:
        """Which of the multipliers surely hold the design (booleans), shape (q,)."""
        holds = np.abs(self.multipliers) > self.spreads
        holds[: len(self.active)] |= np.array([row.equality for row, _ in self.active], bool)
        return holds

    @property
    def open_directions(self) -> np.ndarray:
        """Orthonormal directions in u that nothing holds, shape (k, d)."""
        return np.asarray(scipy.linalg.null_space(self.normals[:, self.holds].T))


def _smooth_gradient(problem: DesignProblem, design: Design) -> np.ndarray:
    """Of the sum but for the spectral radius's part."""
    weights, _ = smooth_weights(problem)
    return problem.gradient(design.u, problem.objective(design.known, weights).slopes)


def balance_of(problem: DesignProblem, design: Design, scale: float) -> Balance:
    u, known = design
    weights, of_radius = smooth_weights(problem)
    total, more = problem.objective(known, weights), int(of_radius > 0.0)
    gradient = np.append(problem.gradient(u, total.slopes), [of_radius] * more) / scale
    errors = np.append(np.abs(problem.gradient(u, total.slope_errors)), [0.0] * more) / scale
    radius = known.values["spectral_radius"] if of_radius else np.inf
    rows: list[tuple[AnyRow, bool]] = [(row, False) for row in rows_of(problem)]
    rows += [(row, True) for row in (cluster_rows(problem, radius) if of_radius else ())]
    rows = [pair for pair in rows if pair[0].is_active(known)]
    normals = [
        np.append(problem.gradient(u, row.slopes(known)), [row.by_bound(known) * in_sum] * more)
        for row, in_sum in rows
    ]
    sizes = np.linalg.norm(np.reshape(normals, (-1, len(gradient))), axis=1)
    # Where multipliers pass through each other a condition's gradient vanishes, and tells nothing.
    large = np.flatnonzero(sizes > _VANISHING * np.max(sizes, initial=0.0)).tolist()
    rows, normals = [rows[k] for k in large], [normals[k] for k in large]
    normals += [side * np.eye(len(gradient))[place] for place, side in _at_bounds(u)]
    matrix = np.reshape(normals, (-1, len(gradient))).T
    error, least = np.zeros_like(matrix), np.zeros(len(normals))
    multipliers = np.zeros(len(normals))
    for k, (row, _) in enumerate(rows):
        error[: len(u), k] = np.abs(problem.gradient(u, row.slope_errors(known)))
        least[k] = -np.inf if row.equality else 0.0
    if normals:
        limits = least, np.inf
        multipliers = scipy.optimize.lsq_linear(matrix, gradient, limits, method="bvls").x
    errors += error @ np.abs(multipliers)
    spreads = np.abs(np.linalg.pinv(matrix)) @ errors
    # What surely holds the design makes up for any error along its normal.
    sure = matrix[:, (multipliers > spreads) | (least < 0.0)]
    across = np.eye(len(gradient)) - sure @ np.linalg.pinv(sure)
    with np.errstate(invalid="ignore"):  # of errors without bound
        errors = np.abs(across) @ errors
    return Balance(gradient - matrix @ multipliers, errors, rows, multipliers, spreads, matrix)


def lagrangian_change(
    problem: DesignProblem, here: Design, there: Design, scale: float
) -> np.ndarray:
    """How the gradient of the scaled Lagrangian changes, with the multipliers of `there`."""
    slopes = functools.partial(lagrangian_slopes, problem, balance_of(problem, there, scale), scale)
    one, other = (problem.gradient(design.u, slopes(design)[0]) for design in (here, there))
    return other - one


def lagrangian_slopes(
    problem: DesignProblem, balance: Balance, scale: float, design: Design
) -> np.ndarray:
    """Derivatives of the scaled Lagrangian with respect to all p parameters, and their errors.

    The multipliers are given, and the radius's part of the sum is left out.

    Returns:
        Shape (2, p).
    """
    weights, _ = smooth_weights(problem)
    total = problem.objective(design.known, weights)
    slopes, errors = total.slopes / scale, total.slope_errors / scale
    for (row, _), multiplier in zip(balance.active, balance.multipliers, strict=False):
        slopes = slopes - multiplier * row.slopes(design.known)
        errors = errors + abs(multiplier) * row.slope_errors(design.known)
    return np.stack([slopes, errors])


class Curvature(NamedTuple):
    """The reduced Hessian of an optimum: that of the Lagrangian where what holds it is kept.

    It is for one whole range between a variable's bounds, relative to the objective's own size.

    Attributes:
        values: its eigenvalues in increasing order, one for each direction that is left; none
            where multipliers of the gait play a part, beside which it is not smooth.
        error: what they are known to.
    """

    values: np.ndarray
    error: float


class SecondDerivatives(NamedTuple):
    """Second derivatives of a scaled Lagrangian along the d directions that nothing holds.

    Attributes:
        scale: the objective's own size, by which the Lagrangian is divided.
        balance: the Lagrangian's multipliers.
        directions: orthonormal directions in u, shape (k, d).
        slopes: derivatives along them of its derivatives with respect to u, and behind these of
            those with respect to all parameters, shape (d, k + p); NaN where designs beside this
            one have no gait.
        errors: estimated errors of the slopes, of the same shape.
    """

    scale: float
    balance: Balance
    directions: np.ndarray
    slopes: np.ndarray
    errors: np.ndarray

    @property
    def curvature(self) -> Curvature:
        """The reduced Hessian."""
        k, d = self.directions.shape
        hessian, errors = self.slopes[:, :k] @ self.directions, self.errors[:, :k]
        if not np.all(np.isfinite(hessian)):
            return Curvature(np.full(d, np.nan), np.inf)
        error = np.max(np.sum(errors, axis=1), initial=0.0)
        error += np.max(np.abs(hessian - hessian.T), initial=0.0)
        return Curvature(np.linalg.eigvalsh(0.5 * (hessian + hessian.T)), float(error))


def scale_at(problem: DesignProblem, design: Design) -> float:
    """The objective's own size at a design."""
    return max(abs(problem.objective(design.known).value), 1e-300)


def places_beside(u: np.ndarray, direction: np.ndarray) -> list[np.ndarray]:
    """Where within the bounds gradients are compared for the curvature along a direction."""
    ends = [u + side * _ASIDE * direction for side in (1.0, -1.0)]
    return [end for end in ends if np.all((end >= 0.0) & (end <= 1.0))]


def second_derivatives_of(problem: DesignProblem, design: Design) -> SecondDerivatives | None:
    """Differences of gradients beside a design; None where multipliers of the gait play a part."""
    scale = scale_at(problem, design)
    balance = balance_of(problem, design, scale)
    is_smooth = len(balance.left) == len(design.u)
    if not is_smooth or not all(isinstance(row, Row) for row, _ in balance.active):
        return None
    directions = balance.open_directions

    def rows_at(there: Design) -> np.ndarray:
        """Derivatives with respect to u and all parameters, and their errors, (2, k + p)."""
        rows = lagrangian_slopes(problem, balance, scale, there)
        return np.hstack([problem.gradient(there.u, rows), rows])

    here = rows_at(design)
    slopes, errors = np.full((2, directions.shape[1], here.shape[1]), np.nan)
    for row, bars, direction in zip(slopes, errors, directions.T, strict=True):
        known = [(u, problem.beside(u)) for u in places_beside(design.u, direction)]
        sides = [Design(u, each) for u, each in known if each is not None]
        sides = sides if len(sides) == 2 else [*sides, design][:2]
        if len(sides) == 2:
            one, other = sides
            (first, second), length = map(rows_at, sides), (one.u - other.u) @ direction
            row[:] = (first[0] - second[0]) / length
            bars[:] = (np.abs(first[1]) + np.abs(second[1])) / abs(length)
            # What differences leave out, where one more derivative is of the size of the last.
            is_central = other is not design
            bars += _ASIDE ** (2 if is_central else 1) * np.abs(row)
    return SecondDerivatives(scale, balance, directions, slopes, errors)


def curvature_of(problem: DesignProblem, design: Design) -> Curvature:
    """The reduced Hessian by differences of gradients of designs beside it."""
    second = second_derivatives_of(problem, design)
    return Curvature(np.zeros(0), 0.0) if second is None else second.curvature


def optimality_of(problem: DesignProblem, design: Design) -> Optimality:
    """Multipliers that balance the gradient best, in the least-squares sense, with right signs.

    The design's own derivatives alone count. Where multipliers meet, the conditions on their
    symmetric functions have derivatives that span all directions in which the radius grows. The
    multipliers of a requirement or a bound are those of moving it upwards, in its units.
    """
    (u, known), variables, sense = design, problem.variables, problem.sense
    scale = scale_at(problem, design)
    balance = balance_of(problem, design, scale)
    count = len(balance.active)
    held: dict[tuple[str, float, float], tuple[float, float]] = {}
    for (row, in_sum), multiplier, error in zip(
        balance.active, balance.multipliers[:count], balance.spreads[:count], strict=True
    ):
        if not in_sum:
            size = scale * row.by_bound(known)
            total, spread = held.get(row[:3], (0.0, 0.0))
            held[row[:3]] = total - multiplier * size, spread + error * abs(size)
    requirements = []
    for key in dict.fromkeys(row[:3] for row in rows_of(problem)):
        (name, bound, _), (multiplier, error) = key, held.get(key, (0.0, 0.0))
        value, off = known.values[name], known.errors[name]
        multiplier, error = float(sense * multiplier), float(error)
        requirements.append(Held(name, bound, value, off, key in held, multiplier, error))
    values, rates, bounds = variables.values(u), variables.rates(u), []
    for (place, side), multiplier, error in zip(
        _at_bounds(u), balance.multipliers[count:], balance.spreads[count:], strict=True
    ):
        name, bound, rate = variables.names[place], float(values[place]), float(rates[place])
        multiplier = float(side * multiplier * (scale * sense) / rate)
        error = float(error * abs(scale * sense / rate))
        bounds.append(Held(name, bound, bound, 0.0, True, multiplier, error))
    return Optimality(
        residual=float(np.max(np.abs(balance.left))),
        error=float(np.max(balance.errors)),
        excess=problem.excess(known),
        requirements=tuple(requirements),
        bounds=tuple(bounds),
    )


def doubt_of(problem: DesignProblem, design: Design) -> str:
    """Why a design does not count as an optimum, in a sentence; nothing where it does."""
    optimality = optimality_of(problem, design)
    residual, error = optimality.residual, optimality.error
    if not residual <= OPTIMAL:
        return f"The derivatives do not balance: {residual:.1e} of the objective is left."
    if not error <= OPTIMAL:
        return f"The residual is known to within {error:.1e} of the objective only."
    for held in optimality.requirements:
        # Where multipliers meet, it is the conditions on them that are known, and kept too well.
        by_cluster = problem.has_cluster and held.name == "spectral_radius"
        if held.active and not (by_cluster or held.error <= OPTIMAL * scale_of(held.bound)):
            return f"What holds it, {held.name}, is known to within {held.error:.1e} only."
    near = [other for other in problem.asked if is_near(design, other)]
    if not all(_explains(problem, design, e) or _explains_nearer(problem, design, e) for e in near):
        return "Designs tried nearby differ from it by other amounts than the derivatives say."
    curvature = curvature_of(problem, design)
    least = np.min(curvature.values, initial=np.inf)
    if least < -curvature.error:
        return f"The objective curves down in a direction that nothing holds: {least:.1e}."
    return ""


def is_near(design: Design, other: Design) -> bool:
    """Whether the difference of two designs shows what their derivatives are."""
    return bool(_NEAR[0] <= np.max(np.abs(other.u - design.u)) <= _NEAR[1])


class _Missed(NamedTuple):
    """A difference of the smooth sum of two designs, what derivatives miss of it, and its bar."""

    difference: float
    off: float
    bar: float


def _missed(problem: DesignProblem, design: Design, other: Design) -> _Missed:
    (weights, _), move, pair = smooth_weights(problem), other.u - design.u, (design, other)
    one, two = (problem.objective(end.known, weights) for end in pair)
    first, second = (_smooth_gradient(problem, end) @ move for end in pair)
    spread = problem.gradient(design.u, one.slope_errors) @ np.abs(move)
    bar = one.error + two.error + abs(spread) + _BEND * abs(second - first)
    difference = two.value - one.value
    return _Missed(difference, abs(difference - 0.5 * (first + second)), bar)


def _explains(problem: DesignProblem, design: Design, other: Design) -> bool:
    """Whether derivatives explain the difference of the smooth sum of a design that is near."""
    missed, move = _missed(problem, design, other), other.u - design.u
    size = abs(problem.objective(design.known).value) * np.max(np.abs(move))
    return bool(missed.off <= OPTIMAL * size + missed.bar)


def _explains_nearer(problem: DesignProblem, design: Design, other: Design) -> bool:
    """Whether they explain that of a design on the way to it, where the sum bends less.

    There the share of the difference itself counts: near an optimum all differences are small.
    """
    for share in _NEARER:
        u = design.u + share * (other.u - design.u)
        known = problem.beside(u)
        if known is None:
            continue
        missed = _missed(problem, design, Design(u, known))
        if missed.off <= OPTIMAL * abs(missed.difference) + missed.bar:
            return True
    return False


def is_untried(u: np.ndarray, begin: np.ndarray) -> bool:
    """Whether a variable inside its bounds is where it began."""
    return bool(np.any((np.abs(u - begin) < _AT_BOUND) & (u > 0.0) & (u < 1.0)))


def is_flat(problem: DesignProblem) -> bool:
    """Whether the objective changes nowhere that was tried, as far as its error bars show."""

    def is_level(design: Design) -> bool:
        total = problem.objective(design.known)
        slopes = problem.gradient(design.u, np.array([total.slopes, total.slope_errors]))
        return bool(np.all(np.abs(slopes[0]) <= _FLAT * abs(total.value) + 3.0 * abs(slopes[1])))

    return len(problem.asked) > 1 and all(map(is_level, problem.asked))


def _at_bounds(u: np.ndarray) -> list[tuple[int, float]]:
    """Variables at a bound: where, and 1 for the lower, −1 for the upper."""
    lower = [(int(k), 1.0) for k in np.flatnonzero(u <= _AT_BOUND)]
    return lower + [(int(k), -1.0) for k in np.flatnonzero(u >= 1.0 - _AT_BOUND)]
