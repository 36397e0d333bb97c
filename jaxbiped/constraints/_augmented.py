"""The augmented Lagrangian formulation: the paper's "augmented"."""

from typing import ClassVar

import equinox as eqx

from jaxbiped._checks import check_at_least
from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod, Constrained
from jaxbiped.constraints._penalised import augmented_multipliers


class Augmented(AbstractConstraintMethod):
    """M q̈⁰ = Q, then (M + A JᵀJ) q̈ᵏ⁺¹ = M q̈ᵏ − A Jᵀ(J̇ q̇ + 2 ζ ω Φ̇ + ω² Φ), repeated.

    The iterations take off what the penalty alone leaves: each shrinks it by about 1/(A s), where
    s ≈ 1/m is an eigenvalue of J M⁻¹ Jᵀ. Their number is fixed, so that nothing depends on a test
    and derivatives are those of the same arithmetic: three leave nothing at the usual A.

    Source: the seed paper, section 4, "augmented"; Bayo, García de Jalón and Serna (1988).

    Attributes:
        A: penalty [kg].
        omega: ω, the frequency at which a violation decays [1/s].
        zeta: ζ, its damping [–].
        iterations: how often.

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
        return augmented_multipliers(system, self.A, self.omega, self.zeta, self.iterations)
