"""Augmented Lagrangian with projections: the paper's "index1aug"."""

from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractProjectingMethod,
    Row,
    applied_impulse,
    gram,
    inverse_masses,
)
from jaxbiped.constraints._penalised import AbstractAugmented, iterate_multipliers
from jaxbiped.linalg._symmetric import factorise


class Index1Augmented(AbstractAugmented, AbstractProjectingMethod):
    """`Augmented` within the step; after it q and q̇ are projected in the mass metric.

    The projections are augmented Lagrangian iterations themselves, (M + A JᵀJ) Δq = −A Jᵀ Φ and
    again with what that leaves, so that constraints which say the same twice do no harm.

    Source: the seed paper, section 4, "index-1 augmented lagrangian"; Bayo and Ledesma (1996).

    Attributes:
        A: penalty [kg].
        omega: ω, the frequency at which a violation decays within a step [1/s].
        zeta: ζ, its damping [–].
        iterations: how often, for accelerations and for each projection.

    Raises:
        ArgumentError: A not above 0, ω or ζ below 0, or fewer than one iteration.
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        weights = inverse_masses(masses)
        factors = factorise(gram(rows, weights, 1.0 / self.A))
        found = iterate_multipliers(factors, gram(rows, weights), residual, self.iterations)
        return applied_impulse(rows, weights, found)
