"""Direct correction after each step: the paper's "described"."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxbiped._checks import check_at_least
from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractProjectingMethod,
    Constrained,
    Row,
    exact_multipliers,
    projection,
)


class DirectCorrection(AbstractProjectingMethod):
    """`Standard` within the step; after it q ← q − Jᵀ(J Jᵀ)⁻¹ Φ, and q̇ likewise with Φ̇.

    Corrections as small as can be in the coordinates' own numbers, metres and radians alike: a
    different split between translation and rotation than the mass metric's.

    Source: the seed paper, section 4, "described", the direct correction method.

    Attributes:
        iterations: corrections of the positions after each step.

    Raises:
        ArgumentError: fewer than one iteration.
    """

    iterations: int = eqx.field(static=True, default=2)
    needs_independent: ClassVar[bool] = True

    def __check_init__(self) -> None:
        check_at_least("iterations", self.iterations, "1", 1)

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system)

    def step_back(self, masses: list[Scalar], rows: list[Row], residual: list[Scalar]) -> Row:
        return projection(rows, [jnp.ones_like(mass) for mass in masses], residual)
