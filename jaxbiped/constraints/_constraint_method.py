"""Constraint methods: the interface of what holds constraints in redundant coordinates."""

import abc
from typing import TYPE_CHECKING, ClassVar, NamedTuple, TypeAlias

import equinox as eqx

from jaxbiped._checks import check_at_least
from jaxbiped._parameter_declaration import AbstractPart
from jaxbiped._types import Scalar, by_numpy
from jaxbiped.linalg._small_matrices import symmetric_factors

if TYPE_CHECKING:
    from typing import ClassVar as AbstractClassVar
else:
    from equinox import AbstractClassVar

Row: TypeAlias = dict[int, Scalar]
"""A row of a Jacobian: its entries by coordinate, those left out that are always zero."""


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
