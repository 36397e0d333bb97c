"""Functions of a design problem: its scaled objective, and requirements as rows.

A row must be at least zero, or zero. An upper bound of the spectral radius is the rows that bound
its cluster, the three leading multipliers: where these meet the radius is not smooth, and its
derivatives are unbounded; the coefficients of the cluster's polynomial are smooth there. In
x = z/ρ = (1 + w)/(1 − w) the circle of radius ρ is the imaginary axis of w, and all multipliers lie
inside where the transformed polynomial E₃w³ + E₂w² + E₁w + E₀ is Hurwitz's: all E at least zero,
and E₁E₂ ≥ E₀E₃ (Jury 1964). At a double or triple multiplier these conditions' gradients span the
normals of the stable polynomials, of which Burke and Overton (Math. Programming 90, 2001) make the
radius's subdifferential.
"""

from typing import NamedTuple, TypeAlias

import numpy as np

from jaxbiped.optimise._design_problem import Design, DesignProblem, scale_of
from jaxbiped.optimise._jacobian_functionals import SYMMETRIC
from jaxbiped.optimise._objective_values import Evaluation

_ACTIVE = 1e-4
"""Largest part of its bound by which an active requirement is missed or kept too well."""
RAISED = 10.0
"""By how much the scaled objective is raised where there is no gait."""
_LEADING = np.array([1.0, 3.0, 3.0, 1.0])
_BY_COEFFICIENT = np.array([[1.0, 1, 1], [1, -1, -3], [-1, -1, 3], [-1, 1, -1]])
"""E = _LEADING + _BY_COEFFICIENT a for x³ + a₁x² + a₂x + a₃."""
CONDITIONS = 5
_SHARE, _LEAST, _MOST = 0.3, 1e-7, 1e-5
"""Part of a condition's error bar by which it is kept too well, and its range: a multiple
multiplier moves by the third root of an error."""
CONJUGATE = 1e-10 * np.array([1.0, 0.0, 0.0, 1.0, 0.0])
"""Margins that keep meeting multipliers conjugate by a little: real ones part by a root."""
_BISECTIONS = 50
_RESTORATIONS, _RESTORED = 3, 1e-10
"""Newton steps onto the requirements that hold a design, and by what part of a bound they may then
be missed."""
_INDEPENDENT = 1e-8
"""Size of a requirement's own direction, as a share of the largest, below which it has none."""
_ONE, _TWO, _THREE = 1e-4, 2e-2, 1e-1
"""Up to which the conditions of one, two and three multipliers at ±ρ are active: third roots of
errors are a per cent."""


class Row(NamedTuple):
    """A requirement as a function that must be at least zero, or zero where `equality`.

    Attributes:
        name: of the measure; `bound` that it is held to, `sign` 1 from below and −1 from above.
    """

    name: str
    bound: float
    sign: float
    equality: bool

    def value(self, known: Evaluation) -> float:
        """How much there is to spare, in units of the bound."""
        return self.sign * (known.values[self.name] - self.bound) / scale_of(self.bound)

    def slopes(self, known: Evaluation) -> np.ndarray:
        return self.sign * known.slopes[self.name] / scale_of(self.bound)

    def slope_errors(self, known: Evaluation) -> np.ndarray:
        return known.slope_errors[self.name] / scale_of(self.bound)

    def by_bound(self, known: Evaluation) -> float:
        return -self.sign / scale_of(self.bound)

    def is_active(self, known: Evaluation) -> bool:
        return self.equality or self.value(known) <= _ACTIVE


class Conditions(NamedTuple):
    """Conditions that are at least zero where all three multipliers lie within a radius.

    Attributes:
        values: shape (5,), of the order of one.
        by_symmetric: derivatives with respect to the symmetric functions, shape (5, 3).
        by_radius: with respect to the radius, shape (5,).
    """

    values: np.ndarray
    by_symmetric: np.ndarray
    by_radius: np.ndarray


def conditions(symmetric: np.ndarray, radius: float) -> Conditions:
    """Of multipliers by their elementary symmetric functions, shape (3,)."""
    by_one = _by_one(radius)
    coefficients = by_one * symmetric
    values = _values(coefficients)
    by_hurwitz = np.vstack([np.eye(4), values[[3, 2, 1, 0]] * [-1.0, 1.0, 1.0, -1.0]])
    by_coefficient = by_hurwitz @ _BY_COEFFICIENT
    by_radius = by_coefficient @ (-np.array([1.0, 2.0, 3.0]) * coefficients / radius)
    return Conditions(values, by_coefficient * by_one, by_radius)


def _by_one(radius: float) -> np.ndarray:
    """Coefficients of the polynomial in x by the symmetric functions."""
    return np.array([-1.0 / radius, 1.0 / radius**2, -1.0 / radius**3])


def _values(coefficients: np.ndarray) -> np.ndarray:
    hurwitz = _LEADING + _BY_COEFFICIENT @ coefficients
    return np.append(hurwitz, hurwitz[1] * hurwitz[2] - hurwitz[0] * hurwitz[3])


def radius_of(symmetric: np.ndarray, margin: np.ndarray | float = 0.0) -> float:
    """The largest modulus of three multipliers by their symmetric functions.

    With margins the least radius at which the conditions exceed them.
    """
    first, second, third = symmetric
    low = float(np.max(np.abs(np.roots([1.0, -first, second, -third])), initial=0.0))
    if not np.any(margin):
        return low
    high = 1.5 * low + 1e-9
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        kept = np.all(_values(_by_one(middle) * symmetric) >= margin)
        low, high = (low, middle) if kept else (middle, high)
    return high


class Cluster(NamedTuple):
    """The symmetric functions of one gait's cluster: values and errors (3,), slopes (3, p)."""

    values: np.ndarray
    errors: np.ndarray
    slopes: np.ndarray
    slope_errors: np.ndarray


def cluster_of(known: Evaluation) -> Cluster:
    return Cluster(*(np.array([part[name] for name in SYMMETRIC]) for part in known[:4]))


class ClusterRow(NamedTuple):
    """One of the conditions that bound the spectral radius from above; as `Row`.

    Attributes:
        name, bound, sign, equality: as of a `Row`.
        place: which condition.
        errors: of the symmetric functions, the same for all designs that are compared.
    """

    name: str
    bound: float
    sign: float
    equality: bool
    place: int
    errors: tuple[float, ...]

    def is_active(self, known: Evaluation) -> bool:
        """Whether the bound holds by it: at a multiple multiplier those of all its places do."""
        *hurwitz, pair = self._conditions(known).values
        if self.place == CONDITIONS - 1:
            return bool(pair <= _ONE)
        for side in (hurwitz, hurwitz[::-1]):
            place = self.place if side is hurwitz else CONDITIONS - 2 - self.place
            small = zip(side[: place + 1], (_ONE, _TWO, _THREE), strict=False)
            if place < len(SYMMETRIC) and all(each <= limit for each, limit in small):
                return True
        return False

    def value(self, known: Evaluation) -> float:
        """How much there is to spare beyond the condition's own error."""
        return float(self._conditions(known).values[self.place]) - self.margin(known)

    def margin(self, known: Evaluation) -> float:
        """A part of the condition's error."""
        error = _SHARE * np.abs(self._by_symmetric(known)) @ self.errors
        return float(np.clip(error, _LEAST, _MOST))

    def slopes(self, known: Evaluation) -> np.ndarray:
        return self._by_symmetric(known) @ cluster_of(known).slopes

    def slope_errors(self, known: Evaluation) -> np.ndarray:
        return np.abs(self._by_symmetric(known)) @ cluster_of(known).slope_errors

    def by_bound(self, known: Evaluation) -> float:
        return float(self._conditions(known).by_radius[self.place])

    def _conditions(self, known: Evaluation) -> Conditions:
        return conditions(cluster_of(known).values, self.bound)

    def _by_symmetric(self, known: Evaluation) -> np.ndarray:
        return self._conditions(known).by_symmetric[self.place]


AnyRow: TypeAlias = Row | ClusterRow


def rows_of(problem: DesignProblem) -> tuple[AnyRow, ...]:
    """The requirements one by one.

    An upper bound of the spectral radius is the conditions on the cluster of leading multipliers,
    and one on the next modulus: all of them are smooth where multipliers meet.
    """
    rows: list[AnyRow] = []
    for each in problem.requirements:
        if each.low is not None and each.low == each.high:
            rows.append(Row(each.name, each.low, 1.0, True))
            continue
        if each.low is not None:
            rows.append(Row(each.name, each.low, 1.0, False))
        if each.high is not None:
            if each.name == "spectral_radius" and problem.has_cluster:
                rows += cluster_rows(problem, each.high)
            else:
                rows.append(Row(each.name, each.high, -1.0, False))
    return tuple(rows)


def restored(problem: DesignProblem, design: Design) -> Design:
    """A design that keeps what holds it to rounding, by the least moves; the same where none does.

    An optimiser may miss requirements by what counts as kept, and gains by it.
    """
    for _ in range(_RESTORATIONS):
        rows = [row for row in rows_of(problem) if isinstance(row, Row)]
        missed = {row: row.value(design.known) for row in rows}
        held = [row for row in rows if row.equality or missed[row] < 0.0]
        if max((abs(missed[row]) for row in held), default=0.0) <= _RESTORED:
            break
        slopes = np.stack([problem.gradient(design.u, row.slopes(design.known)) for row in held])
        free = (design.u > 0.0) & (design.u < 1.0)
        off = np.array([missed[row] for row in held])
        move, *_ = np.linalg.lstsq(slopes * free, -off, rcond=_INDEPENDENT)
        u = np.clip(design.u + move * free, 0.0, 1.0)
        known = problem.beside(u)
        if known is None or problem.excess(known) >= problem.excess(design.known):
            break
        design = Design(u, known)
    return design


def cluster_rows(problem: DesignProblem, bound: float) -> list[AnyRow]:
    """An upper bound of the spectral radius."""
    errors = tuple(cluster_of(problem.asked[0].known).errors.tolist())
    every: list[AnyRow] = [
        ClusterRow("spectral_radius", bound, -1.0, False, place, errors)
        for place in range(CONDITIONS)
    ]
    return [*every, Row("next_modulus", bound, -1.0, False)]


class Functions:
    """The scaled objective and the requirements of a problem, with their gradients."""

    def __init__(self, problem: DesignProblem) -> None:
        self.problem, self.rows = problem, rows_of(problem)
        assert problem.latest is not None
        self.scale = scale_of(problem.objective(problem.latest.known).value)

    def objective(self, u: np.ndarray) -> tuple[float, np.ndarray]:
        known, raised = self._evaluation(u)
        found = self.problem.objective(known)
        gradient = self.problem.gradient(u, found.slopes)
        return found.value / self.scale + raised, gradient / self.scale

    def spare(self, u: np.ndarray, rows: tuple[AnyRow, ...]) -> np.ndarray:
        known, _ = self._evaluation(u)
        return np.asarray([row.value(known) for row in rows])

    def spare_gradients(self, u: np.ndarray, rows: tuple[AnyRow, ...]) -> np.ndarray:
        known, _ = self._evaluation(u)
        return np.stack([self.problem.gradient(u, row.slopes(known)) for row in rows])

    def _evaluation(self, u: np.ndarray) -> tuple[Evaluation, float]:
        u = np.clip(np.asarray(u, dtype=float), 0.0, 1.0)
        known = self.problem.at(u)
        if known is not None:
            return known, 0.0
        assert self.problem.latest is not None
        return self.problem.latest.known, RAISED
