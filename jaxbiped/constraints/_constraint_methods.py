"""The seven constraint methods, by the paper's names."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_at_least, check_choice
from jaxbiped._parameter_declaration import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractConstraintMethod,
    AbstractExactProjection,
    AbstractProjectingMethod,
    Constrained,
    applied_impulse,
    exact_multipliers,
    gram,
    inverse_masses,
    projection,
    stabilised_residual,
)
from jaxbiped.constraints._linkage import Row
from jaxbiped.linalg._small_matrices import SymmetricFactors, symmetric_factors


class Standard(AbstractConstraintMethod):
    """[M Jᵀ; J 0] [q̈; λ] = [Q; γ]: the constraints hold at the level of accelerations only.

    Integration errors of positions and velocities remain, and an error of the velocities makes the
    positions drift without bound.

    Source: the seed paper, section 4, "standard".
    """

    needs_independent: ClassVar[bool] = True

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system)


class Baumgarte(AbstractConstraintMethod):
    """As `Standard` with γ − 2 a Φ̇ − b² Φ for γ: a violation decays as Φ̈ + 2 a Φ̇ + b² Φ = 0.

    Source: the seed paper, section 4, "baumgarte"; Baumgarte (1972).

    Attributes:
        a: damping of a violation [1/s].
        b: its frequency [1/s]; a = b damps critically.

    Raises:
        ArgumentError: a or b below 0.
    """

    a: Parameter = parameter("constraint damping", "$a$", "1/s", minimum=0.0, default=5.0)
    b: Parameter = parameter("constraint frequency", "$b$", "1/s", minimum=0.0, default=5.0)
    needs_independent: ClassVar[bool] = True

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system, stabilised_residual(system, 2.0 * self.a, self.b * self.b))


class AbstractPenalised(AbstractConstraintMethod):
    """A method with a penalty, which is regular whatever the constraints say.

    Attributes:
        A: penalty [kg].
        omega: ω, the frequency at which a violation decays [1/s].
        zeta: ζ, its damping [–].

    Raises:
        ArgumentError: A not above 0, or ω or ζ below 0.
    """

    A: Parameter = parameter("penalty", "$A$", "kg", positive=True, default=1e7)
    omega: Parameter = parameter(
        "constraint frequency", r"$\omega$", "1/s", minimum=0.0, default=10.0
    )
    zeta: Parameter = parameter("constraint damping ratio", r"$\zeta$", minimum=0.0, default=1.0)
    needs_independent: ClassVar[bool] = False

    def penalty_system(self, system: Constrained) -> tuple[SymmetricFactors, list[Scalar]]:
        """Factors of J M⁻¹ Jᵀ + 1/A, and the violation that the applied forces alone would leave.

        By Woodbury's identity (M + A JᵀJ)⁻¹ asks for no more than that k × k matrix, which is
        regular whatever the constraints say, and is well conditioned where M + A JᵀJ is not.
        """
        right = stabilised_residual(system, 2.0 * self.zeta * self.omega, self.omega * self.omega)
        return symmetric_factors(
            gram(system.rows, inverse_masses(system.masses), 1.0 / self.A)
        ), right


class AbstractAugmented(AbstractPenalised):
    """Accelerations by the augmented Lagrangian: the penalty's, and again for what that leaves.

    Attributes:
        iterations: how often, for accelerations and for each projection.

    Raises:
        ArgumentError: fewer than one iteration.
    """

    iterations: int = eqx.field(static=True, default=3)

    def __check_init__(self) -> None:
        check_at_least("iterations", self.iterations, "1", 1)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        factors, right = self.penalty_system(system)
        matrix = gram(system.rows, inverse_masses(system.masses))
        return iterate_multipliers(factors, matrix, right, self.iterations)


def iterate_multipliers(
    factors: SymmetricFactors,
    matrix: list[list[Scalar]],
    right: list[Scalar],
    iterations: int,
) -> list[Scalar]:
    """λ after some iterations of λ ← λ + (S + 1/A)⁻¹(r − S λ) from λ = 0; S by its lower half.

    An error of λ that the constraints feel shrinks by 1/(1 + A s) each time, s the eigenvalue of S
    that it belongs to.
    """
    found = factors.solve(right)
    size = len(right)
    for _ in range(iterations - 1):
        left = []
        for i in range(size):
            row = [matrix[max(i, j)][min(i, j)] * found[j] for j in range(size)]
            left.append(right[i] - sum(row[1:], row[0]))
        found = [x + dx for x, dx in zip(found, factors.solve(left), strict=True)]
    return found


class Penalty(AbstractPenalised):
    """(M + A JᵀJ) q̈ = Q − A Jᵀ(J̇ q̇ + 2 ζ ω Φ̇ + ω² Φ): stiff springs in place of constraints.

    The joint is held by λ = A (Φ̈ + 2 ζ ω Φ̇ + ω² Φ), so a loaded joint is open by about λ/(A ω²).
    Accelerations and forces have a relative error of 1/(A s), where s ≈ 1/m is an eigenvalue of J
    M⁻¹ Jᵀ: 2e-11 at the walker's hip. The usual A of 1e7 kg belongs to solving with M + A JᵀJ,
    which a larger A makes ill-conditioned. Here 1/A is added to J M⁻¹ Jᵀ instead, which does no
    harm; as A grows, the method approaches `Baumgarte` with a = ζ ω and b = ω. Repeated constraints
    share the load, with an error of A s roundings.

    Source: the seed paper, section 4, "penalty"; Bayo, García de Jalón and Serna (1988).
    """

    A: Parameter = parameter("penalty", "$A$", "kg", positive=True, default=1e10)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        factors, right = self.penalty_system(system)
        return factors.solve(right)


class Augmented(AbstractAugmented):
    """M q̈⁰ = Q, then (M + A JᵀJ) q̈ᵏ⁺¹ = M q̈ᵏ − A Jᵀ(J̇ q̇ + 2 ζ ω Φ̇ + ω² Φ), repeated.

    The iterations remove the violation that the penalty alone leaves: each multiplies it by about
    1/(A s), where s ≈ 1/m is an eigenvalue of J M⁻¹ Jᵀ. Their number is fixed, so derivatives are
    those of the same arithmetic. At the usual A, three iterations suffice.

    Source: the seed paper, section 4, "augmented"; Bayo, García de Jalón and Serna (1988).
    """


class Index1(AbstractExactProjection):
    """`Standard` within the step; after it q and q̇ are projected in the mass metric.

    Δq = −M⁻¹Jᵀ(J M⁻¹ Jᵀ)⁻¹ Φ, repeated, then likewise q̇ with Φ̇.

    Source: the seed paper, section 4, names an "index-1 projection method" and does not define it;
    this is the usual meaning.
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        return projection(rows, inverse_masses(masses), residual)


class Index1Augmented(AbstractAugmented, AbstractProjectingMethod):
    """`Augmented` within the step; after it q and q̇ are projected in the mass metric.

    The projections are themselves augmented Lagrangian iterations, (M + A JᵀJ) Δq = −A Jᵀ Φ,
    repeated with the remaining violation. Repeated constraints are therefore allowed.

    Source: the seed paper, section 4, "index-1 augmented lagrangian"; Bayo and Ledesma (1996).
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        weights = inverse_masses(masses)
        factors = symmetric_factors(gram(rows, weights, 1.0 / self.A))
        found = iterate_multipliers(factors, gram(rows, weights), residual, self.iterations)
        return applied_impulse(rows, weights, found)


class DirectCorrection(AbstractExactProjection):
    """`Standard` within the step; after it q ← q − Jᵀ(J Jᵀ)⁻¹ Φ, and q̇ likewise with Φ̇.

    The corrections are the smallest in the coordinates' own numbers, metres and radians alike, so
    they split differently between translation and rotation than in the mass metric.

    Source: the seed paper, section 4, "described", the direct correction method.
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        return projection(rows, [jnp.ones_like(mass) for mass in masses], residual)


CONSTRAINT_METHODS: dict[str, type[AbstractConstraintMethod]] = {
    "standard": Standard,
    "baumgarte": Baumgarte,
    "penalty": Penalty,
    "augmented": Augmented,
    "index1": Index1,
    "index1aug": Index1Augmented,
    "described": DirectCorrection,
}
"""Names of the methods, as the seed paper's section 4 has them."""


def method_named(method: str | AbstractConstraintMethod) -> AbstractConstraintMethod:
    """The method of that name with its usual constants, or the method itself where one is given.

    Raises:
        ArgumentError: an unknown name.
    """
    if isinstance(method, AbstractConstraintMethod):
        return method
    check_choice("method", method, CONSTRAINT_METHODS)
    return CONSTRAINT_METHODS[method]()


def name_of(method: AbstractConstraintMethod) -> str:
    """The paper's name of a method."""
    return next(name for name, kind in CONSTRAINT_METHODS.items() if type(method) is kind)
