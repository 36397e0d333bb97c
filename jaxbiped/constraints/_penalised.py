"""Penalty and augmented Lagrangian systems, shared by the methods that use them."""

from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import Constrained, gram, inverse_masses, stabilised
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


def augmented_multipliers(
    system: Constrained, A: Scalar, omega: Scalar, zeta: Scalar, iterations: int
) -> list[Scalar]:
    """λ of the augmented Lagrangian: the penalty's, and again for what that leaves."""
    factors, right = penalty_system(system, A, omega, zeta)
    return iterate_multipliers(
        factors, gram(system.rows, inverse_masses(system.masses)), right, iterations
    )


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
