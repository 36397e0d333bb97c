"""How exactly gaits and return maps are solved."""

from jaxbiped.solve._accuracy import ACCURACIES
from jaxbiped.solve._passage import Precision

GAIT_ACCURACIES = ("balanced", "tight")
"""The accuracies of `ACCURACIES` that derivatives can be asked for."""
MOST_SOLVER_STEPS = {"balanced": 4096, "tight": 32768}
"""Cap on the solver's attempted steps to the next arrival."""
_TANGENT_SHARE = 10.0
"""Tolerance of the derivatives, in units of the state's."""


def precision_of(accuracy: str) -> Precision:
    """Tolerances of state and derivatives."""
    rtol = ACCURACIES[accuracy]
    return Precision(rtol, _TANGENT_SHARE * rtol)
