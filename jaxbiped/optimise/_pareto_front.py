"""Pareto fronts: best values of one measure under several bounds on another."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.optimise._objectives import Measure, check_objective
from jaxbiped.optimise._optimise_gait import Goal, optimise_gait
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.optimise._requirements import SubjectTo, requirements_of
from jaxbiped.scene._scene import AbstractScene


class ParetoFront(NamedTuple):
    """Best values of one measure under n bounds on another.

    Attributes:
        bounds: bounds on the other measure, in the given order, shape (n,).
        optima: the optimum for each bound.
    """

    bounds: np.ndarray
    optima: tuple[Optimum, ...]

    def values(self, name: str) -> np.ndarray:
        """Values of a measure along the front, shape (n,)."""
        return np.asarray([each.known.values[name] for each in self.optima])


def pareto_front(
    scene: AbstractScene,
    *,
    vary: Mapping[str, tuple[float, float]],
    against: str | Measure,
    bounds: Sequence[float] | np.ndarray,
    upper: bool = True,
    maximise: Goal = None,
    minimise: Goal = None,
    subject_to: SubjectTo = None,
    **options: Any,
) -> ParetoFront:
    """The trade-off between two measures: the best of one under several bounds on the other.

    Each search begins at the previous optimum, so give the bounds in order.

    Args:
        scene: the walker to begin from.
        vary: as for `optimise_gait`.
        against: the other measure.
        bounds: bounds on the other measure, shape (n,).
        upper: whether they are upper bounds.
        maximise, minimise: as for `optimise_gait`.
        subject_to: further requirements.
        options: other options of `optimise_gait`; a `store` keeps the evaluations of all points.

    Returns:
        The front.

    Raises:
        ArgumentError: an argument is not allowed.
    """
    name, _ = check_objective(against, scene, "against")
    values = np.asarray(bounds, dtype=float)
    if values.ndim != 1 or not values.size:
        raise ArgumentError(f"bounds has the shape {values.shape}: it must be (n,), n at least 1.")
    more = requirements_of(scene, subject_to)
    if name in more.measures:
        raise ArgumentError(f"subject_to has {name!r} already: the front bounds it itself.")
    others = {more.given[each.name]: (each.low, each.high) for each in more.each}
    optima: list[Optimum] = []
    for bound in values.tolist():
        held = {**others, against: (None, bound) if upper else (bound, None)}
        begin = optima[-1].scene if optima else scene
        optima.append(
            optimise_gait(
                begin, vary=vary, maximise=maximise, minimise=minimise, subject_to=held, **options
            )
        )
    return ParetoFront(values, tuple(optima))
