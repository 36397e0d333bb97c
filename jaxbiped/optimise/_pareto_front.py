"""Pareto front: the trade between two measures of a gait."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.optimise._objectives import check_objective
from jaxbiped.optimise._optimise_gait import optimise_gait
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.optimise._requirements import SubjectTo, requirements_of
from jaxbiped.scene._scene import RigidScene, Scene


class ParetoFront(NamedTuple):
    """Best values of one measure under bounds of another, n points.

    Attributes:
        bounds: of the other measure, in the order they were asked for, shape (n,).
        optima: at each of them.
    """

    bounds: np.ndarray
    optima: tuple[Optimum, ...]

    def values(self, name: str) -> np.ndarray:
        """A measure along the front, shape (n,)."""
        return np.asarray([each.known.values[name] for each in self.optima])


def pareto_front(
    scene: Scene | RigidScene,
    *,
    vary: Mapping[str, tuple[float, float]],
    against: str,
    bounds: Sequence[float] | np.ndarray,
    upper: bool = True,
    maximise: str | None = None,
    minimise: str | None = None,
    subject_to: SubjectTo = None,
    **options: Any,
) -> ParetoFront:
    """The trade between two measures: the best of one under each of several bounds of the other.

    Each optimum is where the next search begins, so give the bounds in order.

    Args:
        scene: the walker to begin from.
        vary: as for `optimise_gait`.
        against: the other measure.
        bounds: of it, shape (n,).
        upper: whether they are upper bounds.
        maximise, minimise: as for `optimise_gait`.
        subject_to: what else must hold.
        options: others of `optimise_gait`; a `store` keeps the evaluations of all points.

    Returns:
        The front.

    Raises:
        ArgumentError: an argument that is not allowed.
    """
    check_objective(against, scene, "against")
    values = np.asarray(bounds, dtype=float)
    if values.ndim != 1 or not values.size:
        raise ArgumentError(f"bounds has the shape {values.shape}: it must be (n,), n at least 1.")
    more = {each.name: (each.low, each.high) for each in requirements_of(scene, subject_to)}
    if against in more:
        raise ArgumentError(f"subject_to has {against!r} already: the front bounds it itself.")
    optima: list[Optimum] = []
    for bound in values.tolist():
        held = {**more, against: (None, bound) if upper else (bound, None)}
        begin = optima[-1].scene if optima else scene
        optima.append(
            optimise_gait(
                begin, vary=vary, maximise=maximise, minimise=minimise, subject_to=held, **options
            )
        )
    return ParetoFront(values, tuple(optima))
