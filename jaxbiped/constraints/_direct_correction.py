"""Direct correction after each step: the paper's "described"."""

import jax.numpy as jnp

from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractExactProjection,
    Row,
    projection,
)


class DirectCorrection(AbstractExactProjection):
    """`Standard` within the step; after it q ← q − Jᵀ(J Jᵀ)⁻¹ Φ, and q̇ likewise with Φ̇.

    Corrections as small as can be in the coordinates' own numbers, metres and radians alike: a
    different split between translation and rotation than the mass metric's.

    Source: the seed paper, section 4, "described", the direct correction method.

    Attributes:
        iterations: corrections of the positions after each step.

    Raises:
        ArgumentError: fewer than one iteration.
    """

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        return projection(rows, [jnp.ones_like(mass) for mass in masses], residual)
