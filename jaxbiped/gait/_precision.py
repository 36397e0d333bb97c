"""How exactly gaits and return maps are solved."""

from jaxbiped.solve._passage import Precision

_PRECISIONS = {"balanced": Precision(3e-7, 3e-6), "tight": Precision(1e-9, 1e-8)}
GAIT_ACCURACIES = tuple(_PRECISIONS)
"""The accuracies that derivatives can be asked for."""
MOST_SOLVER_STEPS = {"balanced": 4096, "tight": 32768}
"""Cap on the solver's attempted steps to the next arrival."""


def precision_of(accuracy: str) -> Precision:
    """Tolerances of state and derivatives."""
    return _PRECISIONS[accuracy]
