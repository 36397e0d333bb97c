"""Penalty and augmented Lagrangian systems, shared by the methods that use them."""

from typing import ClassVar

import equinox as eqx

from jaxbiped._checks import check_at_least
from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractConstraintMethod,
    Constrained,
    gram,
    inverse_masses,
    stabilised,
)
from jaxbiped.linalg._symmetric import Factors, factorise, solve


def penalty_system(
    system: Constrained, A: Scalar, omega: Scalar, zeta: Scalar
) -> tuple[Factors, list[Scalar]]:
    """Factors of J M⁻¹ Jᵀ + 1/A, and the violation that the applied forces alone would leave.

    By Woodbury's identity (M + A JᵀJ)⁻¹ asks for no more than that k × k matrix, which is regular
    whatever the constraints say, and is well conditioned where M + A JᵀJ is not.
    """
    right = stabilised(system, 2.0 * zeta * omega, omega * omega)
    return factorise(gram(system.rows, inverse_masses(system.masses), 1.0 / A)), right


class AbstractAugmented(AbstractConstraintMethod):
    """Accelerations by the augmented Lagrangian: the penalty's, and again for what that leaves.

    Raises:
        ArgumentError: A not above 0, ω or ζ below 0, or fewer than one iteration.
    """

    A: Parameter = parameter("penalty", "$A$", "kg", positive=True, default=1e7)
    omega: Parameter = parameter(
        "constraint frequency", r"$\omega$", "1/s", minimum=0.0, default=10.0
    )
    zeta: Parameter = parameter("constraint damping ratio", r"$\zeta$", minimum=0.0, default=1.0)
    iterations: int = eqx.field(static=True, default=3)
    needs_independent: ClassVar[bool] = False

    def __check_init__(self) -> None:
        check_at_least("iterations", self.iterations, "1", 1)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        factors, right = penalty_system(system, self.A, self.omega, self.zeta)
        matrix = gram(system.rows, inverse_masses(system.masses))
        return iterate_multipliers(factors, matrix, right, self.iterations)


def iterate_multipliers(
    factors: Factors,
    matrix: list[list[Scalar]],
    right: list[Scalar],
    iterations: int,
) -> list[Scalar]:
    """λ after some iterations of λ ← λ + (S + 1/A)⁻¹(r − S λ) from λ = 0; S by its lower half.

    An error of λ that the constraints feel shrinks by 1/(1 + A s) each time, s the eigenvalue of S
    that it belongs to.
    """
    found = solve(factors, right)
    size = len(right)
    for _ in range(iterations - 1):
        left = []
        for i in range(size):
            row = [matrix[max(i, j)][min(i, j)] * found[j] for j in range(size)]
            left.append(right[i] - sum(row[1:], row[0]))
        found = [x + dx for x, dx in zip(found, solve(factors, left), strict=True)]
    return found
