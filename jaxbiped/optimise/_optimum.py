"""Optimum: the best design that an optimisation came to, with its gait."""

from typing import NamedTuple

from jaxbiped.continuation._nearest_bifurcation import range_of
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._objectives import Evaluation
from jaxbiped.optimise._optimality import Optimality, optimality_of
from jaxbiped.optimise._optimisers import Ended
from jaxbiped.optimise._runs import Iteration, Outcome, Runs
from jaxbiped.scene._scene import RigidScene, Scene


class Optimum(NamedTuple):
    """The best design that an optimisation came to.

    Attributes:
        outcome: how it ended.
        message: the optimiser's own words; and which fold or doubling does not lie in its range.
        scene: of the best design.
        gait: its gait, with the sensitivities to all parameters.
        variables: its parameters by name.
        objective: the sum that was asked for.
        error: its estimated error.
        known: all measures that play a part, with gradients and errors.
        optimality: what the conditions of optimality say.
        history: every iterate, of all runs one behind the other.
        evaluations: designs whose gait was found.
        lost: how often none was, or a measure of it was not finite.
        unmeasured: gaits of the latter kind.
    """

    outcome: Outcome
    message: str
    scene: Scene | RigidScene
    gait: Gait
    variables: dict[str, float]
    objective: float
    error: float
    known: Evaluation
    optimality: Optimality
    history: list[Iteration]
    evaluations: int
    lost: int
    unmeasured: int

    def __repr__(self) -> str:
        variables = ", ".join(f"{name}={value:.6g}" for name, value in self.variables.items())
        return (
            f"Optimum({self.outcome}, objective={self.objective:.6g}, {variables}, "
            f"engine={self.gait.engine}, {self.evaluations} gaits)"
        )


def _message(problem: DesignProblem, best: Design, ended: Ended) -> str:
    """The optimiser's own words, and which bifurcations the best design does not meet."""
    low, high = range_of(problem.scene_at(best.u), "slope")
    ensemble = problem.ensemble
    return " ".join(
        [
            ended.message,
            *([ensemble.words] if ensemble and ensemble.criterion == "worst" else []),
            *(
                f"{name}: none from {low:.6g} to {high:.6g} rad."
                for name in best.known.beyond_range
            ),
        ]
    )


def optimum_of(problem: DesignProblem, runs: Runs) -> Optimum:
    """The best of the designs that runs came to."""
    best = runs.best
    assert best is not None
    value, _, error = problem.objective(best.known)
    return Optimum(
        outcome=runs.outcome(),
        message=_message(problem, best, runs.ended),
        scene=problem.scene_at(best.u),
        gait=problem.gait_of(best),
        variables=problem.variables.named(best.u),
        objective=problem.sense * value,
        error=error,
        known=best.known,
        optimality=optimality_of(problem, best),
        history=runs.history,
        evaluations=problem.evaluations.count,
        lost=problem.lost,
        unmeasured=problem.unmeasured,
    )
