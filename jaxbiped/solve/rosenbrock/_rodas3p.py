"""Rodas3P: third order."""

from typing import Any, ClassVar

from jaxbiped.solve.rosenbrock._rosenbrock_solver import AbstractRosenbrock
from jaxbiped.solve.rosenbrock._tableau import RosenbrockTableau


class Rodas3P(AbstractRosenbrock):
    """Third order, five stages, L-stable, stiffly accurate, without order reduction on
    Prothero-Robinson problems; dense output of third order. The last two stages share one
    evaluation of the vector field, and their difference is the error estimate.

    Source: Steinebach, Rosenbrock methods within OrdinaryDiffEq.jl, JuliaCon Proceedings (2024).
    """

    tableau: ClassVar[RosenbrockTableau] = RosenbrockTableau(
        gamma=1.0 / 3.0,
        a=(
            (4.0 / 3.0,),
            (0.0, 0.0),
            (2.90625, 3.375, 0.40625),
            (2.90625, 3.375, 0.40625, 0.0),
        ),
        c=(
            (-4.0,),
            (8.25, 6.75),
            (1.21875, -5.0625, -1.96875),
            (4.03125, -15.1875, -4.03125, 6.0),
        ),
        alpha=(0.0, 4.0 / 9.0, 0.0, 1.0, 1.0),
        gammas=(1.0 / 3.0, -1.0 / 9.0, 1.0, 0.0, 0.0),
        dense=(
            (1.78125, 6.75, 0.15625, -6.0, -1.0),
            (4.21875, -15.1875, -3.09375, 9.0, 0.0),
        ),
        error=(0.0, 0.0, 0.0, -1.0, 1.0),
    )

    def order(self, terms: Any) -> int:
        """Order of convergence: 3."""
        return 3
