"""Constraint methods: their interface, and the algebra of constraints with projection onto them."""

import abc
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._checks import ArgumentError, check_at_least
from jaxbiped._parameter_declaration import AbstractPart
from jaxbiped._types import Scalar, by_numpy
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.compiler import kept_alone
from jaxbiped.constraints._linkage import Linkage, Row, constraints_of, masses_of, row_times
from jaxbiped.linalg._small_matrices import symmetric_factors

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar


class Constrained(NamedTuple):
    """A constrained system at one state: n coordinates q, k constraints Φ(q) = 0.

    Attributes:
        masses: diagonal of M [kg, kg·m²], n entries.
        applied: applied forces Q [N, N·m], n entries.
        rows: of J = ∂Φ/∂q, k of them.
        violation: Φ, k entries.
        rate: Φ̇ = J q̇, k entries.
        bias: γ = −J̇ q̇, k entries.
    """

    masses: list[Scalar]
    applied: list[Scalar]
    rows: list[Row]
    violation: list[Scalar]
    rate: list[Scalar]
    bias: list[Scalar]


class AbstractConstraintMethod(AbstractPart):
    """Finds the multipliers λ of M q̈ = Q − Jᵀ λ. A pytree of its constants.

    Attributes:
        needs_independent: whether repeated constraints make the method singular.
        projects: whether it also corrects the state after every step. A property of the class.
    """

    needs_independent: AbstractClassVar[bool]
    projects: ClassVar[bool] = False

    @abc.abstractmethod
    def multipliers(self, system: Constrained) -> list[Scalar]:
        """λ of each constraint [N]; −Jᵀ λ are the constraints' forces on the coordinates."""


class AbstractProjectingMethod(AbstractConstraintMethod):
    """A method that also projects positions and velocities onto the constraints after every step.

    Attributes:
        iterations: number of corrections of the positions after each step.
    """

    projects: ClassVar[bool] = True
    iterations: eqx.AbstractVar[int]

    @abc.abstractmethod
    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        """The correction −W Jᵀ(J W Jᵀ)⁻¹ r of each coordinate that removes a residual r.

        The formula is the same for positions, with r = Φ, and for velocities, with r = Φ̇. W is the
        inverse of the metric.
        """


def gram(rows: list[Row], weights: list[Scalar], shift: Scalar | None = None) -> list[list[Scalar]]:
    """Lower half of J W Jᵀ + s I for a diagonal W. Default: s = 0."""
    matrix = []
    for i, row in enumerate(rows):
        entries = []
        for other in rows[: i + 1]:
            shared = [row[c] * other[c] * weights[c] for c in row if c in other]
            entries.append(sum(shared[1:], shared[0]) if shared else 0.0 * weights[0])
        if shift is not None:
            entries[i] = entries[i] + shift
        matrix.append(entries)
    return matrix


def free_residual(system: Constrained) -> list[Scalar]:
    """J M⁻¹ Q − γ: by how much the applied forces alone would break the constraints."""
    free = [force / mass for force, mass in zip(system.applied, system.masses, strict=True)]
    return [
        sum((entry * free[c] for c, entry in row.items()), -bias)
        for row, bias in zip(system.rows, system.bias, strict=True)
    ]


def stabilised_residual(system: Constrained, damping: Scalar, stiffness: Scalar) -> list[Scalar]:
    """J M⁻¹ Q − γ + damping Φ̇ + stiffness Φ."""
    parts = zip(free_residual(system), system.rate, system.violation, strict=True)
    return [free + damping * rate + stiffness * off for free, rate, off in parts]


def inverse_masses(masses: list[Scalar]) -> list[Scalar]:
    """The diagonal of M⁻¹."""
    return [by_numpy(lambda _, mass: 1.0 / mass, mass) for mass in masses]


class AbstractExactProjection(AbstractProjectingMethod):
    """The exact multipliers within a step, and after it a projection in a metric of its own.

    Raises:
        ArgumentError: fewer than one iteration.
    """

    iterations: int = eqx.field(static=True, default=2)
    needs_independent: ClassVar[bool] = True

    def __check_init__(self) -> None:
        check_at_least("iterations", self.iterations, "1", 1)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system)


def exact_multipliers(system: Constrained, right: list[Scalar] | None = None) -> list[Scalar]:
    """λ with (J M⁻¹ Jᵀ) λ = right. Default of `right`: the free residual."""
    right = free_residual(system) if right is None else right
    return symmetric_factors(gram(system.rows, inverse_masses(system.masses))).solve(right)


def applied_impulse(rows: list[Row], weights: list[Scalar], multipliers: list[Scalar]) -> Row:
    """−W Jᵀ μ, for the coordinates that any constraint knows."""
    moves: Row = {}
    for row, value in zip(rows, multipliers, strict=True):
        for c, entry in row.items():
            move = -weights[c] * entry * value
            moves[c] = moves[c] + move if c in moves else move
    return moves


def projection(rows: list[Row], weights: list[Scalar], residual: list[Scalar]) -> Row:
    """−W Jᵀ(J W Jᵀ)⁻¹ r for a diagonal W."""
    return applied_impulse(rows, weights, symmetric_factors(gram(rows, weights)).solve(residual))


_LEAST = 1e-10
"""Smallest eigenvalue of J M⁻¹ Jᵀ, in units of the largest, of constraints that are independent."""


def check_independent(
    linkage: Linkage, method: AbstractConstraintMethod, q: Sequence[Scalar]
) -> None:
    """Refuses constraints that say the same twice, where the method cannot bear it.

    Raises:
        ArgumentError: for a method that needs independent constraints. What is being traced, or
            a batch, is not looked at.
    """
    lower = _gram_of(linkage, list(q)) if method.needs_independent else []
    if not lower:
        return
    entries = [entry for row in lower for entry in row]
    if any(isinstance(entry, jax.core.Tracer) or jnp.ndim(entry) for entry in entries):
        return
    matrix = np.zeros((len(lower), len(lower)))
    for i, row in enumerate(lower):
        matrix[i, : i + 1] = matrix[: i + 1, i] = [float(entry) for entry in row]
    values = np.linalg.eigvalsh(matrix)
    excess = int(np.sum(values < _LEAST * values[-1]))
    if excess:
        raise ArgumentError(
            f"method = {type(method).__name__} is not allowed here: {excess} of {len(lower)} "
            "constraints are redundant, because they follow from the others (such as a joint that "
            "is given twice); remove them, or use Penalty, Augmented or Index1Augmented."
        )


@kept_alone
def _gram_of(linkage: Linkage, q: list[Scalar]) -> list[list[Scalar]]:
    """J M⁻¹ Jᵀ of its constraints at rest: the entries of the lower triangle."""
    at = constraints_of(linkage, q, [jnp.zeros_like(value) for value in q])
    return gram(at.rows, inverse_masses(masses_of(linkage)))


_ITERATIONS = 12
"""Of the search for the nearest consistent state: a tenth of a metre is taken off to rounding."""


def correct_step(
    linkage: Linkage,
    method: AbstractProjectingMethod,
    q: Sequence[Scalar],
    v: Sequence[Scalar],
) -> tuple[list[Scalar], list[Scalar]]:
    """Coordinates and rates corrected as a method does after each step.

    Plain arithmetic, a fixed number of times: derivatives pass through as exactly as values.
    """
    masses, q, v = masses_of(linkage), list(q), list(v)
    for _ in range(method.iterations):
        at = constraints_of(linkage, q, v)
        q = _add(q, method.step_back(masses, at.rows, at.violation))
    at = constraints_of(linkage, q, v)
    return q, _add(v, method.step_back(masses, at.rows, at.rate))


@cached_jit
def nearest_consistent(
    linkage: Linkage, q: Sequence[Scalar], v: Sequence[Scalar]
) -> tuple[list[Scalar], list[Scalar]]:
    """The consistent coordinates and rates nearest in the mass metric.

    min Δqᵀ M Δq with Φ(q + Δq) = 0: each iteration solves it with the constraints linearised where
    the last one ended, so that what it converges to is nearest to the start and not only near.
    """
    weights, origin = inverse_masses(masses_of(linkage)), list(q)

    def least(rows: list[Row], residual: list[Scalar]) -> Row:
        # Shifted by nearly nothing, so that constraints that say the same twice share.
        matrix = gram(rows, weights)
        shift = 1e-14 * sum((matrix[i][i] for i in range(1, len(matrix))), matrix[0][0])
        return applied_impulse(
            rows, weights, symmetric_factors(gram(rows, weights, shift)).solve(residual)
        )

    def nearer(_: Scalar, q: list[Scalar]) -> list[Scalar]:
        at = constraints_of(linkage, q, v)
        gone = [a - b for a, b in zip(q, origin, strict=True)]
        left = [off - row_times(row, gone) for off, row in zip(at.violation, at.rows, strict=True)]
        return _add(origin, least(at.rows, left))

    if not constraints_of(linkage, q, v).rows:
        return origin, list(v)
    found = jax.lax.fori_loop(0, _ITERATIONS, nearer, origin)
    at = constraints_of(linkage, found, v)
    return found, _add(v, least(at.rows, at.rate))


def _add(values: Sequence[Scalar], moves: Row) -> list[Scalar]:
    return [value + moves[i] if i in moves else value for i, value in enumerate(values)]
