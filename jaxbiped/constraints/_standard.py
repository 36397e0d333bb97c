"""Lagrange's multipliers, unstabilised: the paper's "standard"."""

from typing import ClassVar

from jaxbiped._types import Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractConstraintMethod,
    Constrained,
    exact_multipliers,
)


class Standard(AbstractConstraintMethod):
    """[M Jᵀ; J 0] [q̈; λ] = [Q; γ]: the constraints hold at the level of accelerations only.

    Whatever error the integrator makes in positions and velocities stays, and an error of the
    velocities makes the positions drift without bound.

    Source: the seed paper, section 4, "standard".
    """

    needs_independent: ClassVar[bool] = True

    def multipliers(self, system: Constrained) -> list[Scalar]:
        return exact_multipliers(system)
