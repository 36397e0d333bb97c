"""Pareto fronts: best values of one measure under several bounds on another."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._quantity import Quantity
from jaxbiped.optimise._objectives import Measure, check_objective
from jaxbiped.optimise._optimise_gait import Goal, goal_of, goal_quantity, optimise_gait
from jaxbiped.optimise._optimum import Optimum, Outcome
from jaxbiped.optimise._requirements import SubjectTo, requirements_of
from jaxbiped.scene._scene import AbstractScene


class ParetoFront(NamedTuple):
    """Best values of one measure under n bounds on another.

    Attributes:
        bounds: bounds on the other measure, in the given order, shape (n,).
        optima: the optimum for each bound.
        against: name of the other measure.
        upper: whether its bounds are upper ones.
        sense: 1 where the objective is minimised, −1 where it is maximised.
        quantity: words, symbol and unit of the objective.
    """

    bounds: np.ndarray
    optima: tuple[Optimum, ...]
    against: str
    upper: bool
    sense: float
    quantity: Quantity

    def values(self, name: str) -> np.ndarray:
        """Values of a measure along the front, shape (n,)."""
        return np.asarray([each.known.values[name] for each in self.optima])

    @property
    def objectives(self) -> np.ndarray:
        """Objectives and their estimated errors, shape (2, n)."""
        return np.array([(each.objective, each.error) for each in self.optima]).T

    @property
    def slopes(self) -> np.ndarray:
        """Derivatives of the objective with respect to the bound, and their errors, shape (2, n).

        They are the bound's multipliers: zero where it does not hold the optimum.
        """
        every = [held for each in self.optima for held in each.optimality.requirements]
        held = [each for each in every if each.name == self.against]
        return np.array([(each.multiplier, each.multiplier_error) for each in held]).T

    @property
    def holds(self) -> np.ndarray:
        """Whether the bound holds the optimum (booleans), shape (n,)."""
        slopes, errors = self.slopes
        return np.abs(slopes) > errors

    @property
    def proven(self) -> np.ndarray:
        """Whether a point is a certified optimum of positive curvature (booleans), shape (n,).

        Where nothing is left to vary there is no curvature, and none is asked for.
        """
        return np.array([_is_proven(each) for each in self.optima])

    @property
    def dominated(self) -> np.ndarray:
        """Whether another point is surely better and no worse against (booleans), shape (n,)."""
        (objectives, errors), sign = self.objectives, 1.0 if self.upper else -1.0
        values, bars = self.sense * objectives, errors[:, None] + errors
        others = sign * self.values(self.against)
        off = np.array([each.known.errors[self.against] for each in self.optima])
        is_better = values[:, None] > values + bars
        return np.any(is_better & (others[:, None] >= others - off[:, None] - off), axis=1)


def _is_proven(optimum: Optimum) -> bool:
    """Whether an optimum is certified and its curvature surely positive."""
    curvature = optimum.curvature
    if optimum.outcome is not Outcome.CONVERGED or curvature is None:
        return False
    return bool(np.min(curvature.values, initial=np.inf) > curvature.error)


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
    weights, sense, measures = goal_of(scene, maximise, minimise)
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
    return ParetoFront(values, tuple(optima), name, upper, sense, goal_quantity(weights, measures))
