"""Precision of gaits and return maps."""

from typing import Any

from jaxbiped.scene._abstract_scene import is_rigid
from jaxbiped.variational._solve_to_section import Precision

_PRECISIONS = {"balanced": Precision(3e-7, 3e-6), "tight": Precision(1e-9, 1e-8)}
# Rolling is smooth, and a gait of it costs little at any precision.
_OF_RIGID = {"balanced": Precision(1e-9, 1e-8), "tight": Precision(1e-12, 1e-11)}
GAIT_ACCURACIES = tuple(_PRECISIONS)
"""The accuracies that derivatives can be asked for."""
MOST_SOLVER_STEPS = {"balanced": 4096, "tight": 32768}
"""Cap on the solver's attempted steps to the next arrival."""


def precision_of(accuracy: str, scene: Any = None) -> Precision:
    """Tolerances of state and derivatives."""
    return (_OF_RIGID if is_rigid(scene) else _PRECISIONS)[accuracy]
