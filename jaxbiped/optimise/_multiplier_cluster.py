"""Multiplier cluster: conditions under which the three leading multipliers lie in a circle.

Where multipliers meet the spectral radius is not smooth, and its derivatives are unbounded; the
coefficients of the cluster's polynomial are smooth there. In x = z/ρ = (1 + w)/(1 − w) the circle
is the imaginary axis of w, and all multipliers lie inside where the transformed polynomial
E₃w³ + E₂w² + E₁w + E₀ is Hurwitz's: all E at least zero, and E₁E₂ ≥ E₀E₃ (Jury 1964). At a double
or triple multiplier these conditions' gradients span the normals of the stable polynomials, of
which Burke and Overton (Math. Programming 90, 2001) make the radius's subdifferential.
"""

from typing import NamedTuple

import numpy as np

from jaxbiped.optimise._jacobian_weights import SYMMETRIC
from jaxbiped.optimise._objective_values import Evaluation

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
_ONE, _TWO, _THREE = 1e-4, 2e-2, 1e-1
"""Up to which the conditions of one, two and three multipliers at ±ρ are active: third roots of
errors are a per cent."""


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
