"""The penalty method: the paper's "penalty"."""

from typing import ClassVar

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod, Constrained
from jaxbiped.constraints._penalised import penalty_system
from jaxbiped.linalg._symmetric import solve


class Penalty(AbstractConstraintMethod):
    """(M + A JᵀJ) q̈ = Q − A Jᵀ(J̇ q̇ + 2 ζ ω Φ̇ + ω² Φ): stiff springs in place of constraints.

    What holds the joint is λ = A (Φ̈ + 2 ζ ω Φ̇ + ω² Φ), so a loaded joint is open by about
    λ/(A ω²), and accelerations and forces are off by a share of 1/(A s), s ≈ 1/m an eigenvalue of
    J M⁻¹ Jᵀ: 2e-11 at the walker's hip. The A of 1e7 kg that is usual elsewhere belongs to solving
    with M + A JᵀJ, which a larger one makes ill-conditioned. Here 1/A is added to J M⁻¹ Jᵀ, which
    it cannot harm; the larger A is, the nearer is `Baumgarte` with a = ζ ω and b = ω. Constraints
    that say the same twice share the load, to A s roundings.

    Source: the seed paper, section 4, "penalty"; Bayo, García de Jalón and Serna (1988).

    Attributes:
        A: penalty [kg].
        omega: ω, the frequency at which a violation decays [1/s].
        zeta: ζ, its damping [–].

    Raises:
        ArgumentError: A not above 0, or ω or ζ below 0.
    """

    A: Parameter = parameter("penalty", "$A$", "kg", positive=True, default=1e10)
    omega: Parameter = parameter(
        "constraint frequency", r"$\omega$", "1/s", minimum=0.0, default=10.0
    )
    zeta: Parameter = parameter("constraint damping ratio", r"$\zeta$", minimum=0.0, default=1.0)
    needs_independent: ClassVar[bool] = False

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return solve(*penalty_system(system, self.A, self.omega, self.zeta))
