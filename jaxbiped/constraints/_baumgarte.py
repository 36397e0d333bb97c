"""Baumgarte's stabilisation: the paper's "baumgarte"."""

from typing import ClassVar

from jaxbiped._parameter import parameter
from jaxbiped._types import Parameter, Scalar
from jaxbiped.constraints._constraint_method import (
    AbstractConstraintMethod,
    Constrained,
    exact_multipliers,
    stabilised,
)


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
        return exact_multipliers(system, stabilised(system, 2.0 * self.a, self.b * self.b))
