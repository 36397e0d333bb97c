"""Projection after each step: the paper's "index1"."""

from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractExactProjection,
    Row,
    inverse_masses,
    projection,
)


class Index1(AbstractExactProjection):
    """`Standard` within the step; after it q and q̇ are projected in the mass metric.

    Δq = −M⁻¹Jᵀ(J M⁻¹ Jᵀ)⁻¹ Φ, repeated, then likewise q̇ with Φ̇.

    Source: the seed paper, section 4, names an "index-1 projection method" and does not define it;
    this is the usual meaning.

    Attributes:
        iterations: corrections of the positions after each step.

    Raises:
        ArgumentError: fewer than one iteration.
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        return projection(rows, inverse_masses(masses), residual)
