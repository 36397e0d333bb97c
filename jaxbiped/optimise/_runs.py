"""Runs of an optimiser over a design problem, restarts among them, and the best design of all."""

import dataclasses
import functools
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from jaxbiped._progress import Stage
from jaxbiped.continuation._critical_values import allows, range_of
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._stability import Bifurcation
from jaxbiped.optimise._design_functions import Functions, restored
from jaxbiped.optimise._design_gaits import are_walks, gaits_near
from jaxbiped.optimise._design_problem import KEPT, Design, DesignProblem, Variables
from jaxbiped.optimise._objectives import OBJECTIVES, with_parts
from jaxbiped.optimise._optimality import (
    OPTIMAL,
    curvature_of,
    doubt_of,
    is_flat,
    is_near,
    optimality_of,
)
from jaxbiped.optimise._optimisers import BY_NAME, RunEnding, run_optax, run_trust_region
from jaxbiped.optimise._optimum import Iteration, Optimum, Outcome
from jaxbiped.optimise._optimum_sensitivities import sensitivities_of

if TYPE_CHECKING:
    import optax

_DRAWN = 8
"""Designs that are drawn for each one that is kept."""
_STAGES = 4
"""Steps in which the gaits of all of them are followed from the first design's."""
_NOT_ENDED = RunEnding(False, "")


@dataclasses.dataclass
class Runs:
    """Runs of an optimiser from one design after the other.

    Attributes:
        problem, iterations, optimiser: of each run.
        now: counts iterates.
        formulation: that brought the first design.
        history: iterates of all runs.
        best: the best design of all.
        ended: how the run ended that came to it; `interrupted` by Ctrl-C.
    """

    problem: DesignProblem
    iterations: int
    optimiser: "str | optax.GradientTransformation"
    now: Stage
    formulation: str = "gait by gait"
    history: list[Iteration] = dataclasses.field(default_factory=list)
    ended: RunEnding = _NOT_ENDED
    interrupted: bool = False

    @property
    def best(self) -> Design:
        return min(self.problem.asked, key=functools.partial(rank_of, self.problem))

    def run(self, begin: Design, ended: RunEnding | None = None) -> None:
        """Runs the optimiser from a design, or only where it is none if a search `ended` there."""
        self.problem.latest = begin
        self.note(begin.u)
        before = self.best
        functions = Functions(self.problem)
        if isinstance(self.optimiser, str):
            optimise = BY_NAME[self.optimiser]
        else:
            optimise = functools.partial(run_optax, transformation=self.optimiser)
        is_polished = False
        if ended is None or not ended.converged:
            ended = optimise(functions, begin.u, self.iterations, self.note)
            is_polished = optimise is run_trust_region
        balanced = optimality_of(self.problem, self.best).residual <= OPTIMAL
        if ended.converged and not is_polished and not balanced:
            # It may have stopped on a ridge of the objective, along which designs get better.
            self.problem.latest = self.best
            on = run_trust_region(functions, self.best.u, self.iterations, self.note)
            ended = RunEnding(
                on.converged,
                f"{ended.message.rstrip('.')}. From there by trust-region: {on.message}",
            )
        best = self.best
        if ended.converged and not any(is_near(best, design) for design in self.problem.asked):
            # Another design shows whether derivatives tell how designs differ.
            self.problem.at(best.u + np.where(best.u < 0.5, 0.01, -0.01))
        better = rank_of(self.problem, self.best) < rank_of(self.problem, before)
        if not self.ended.message or better:
            self.ended = ended

    def outcome(self, best: Design | None = None) -> Outcome:
        """How it ended: converged only where the design is certified as an optimum, too.

        It is the best one, or one that keeps what holds it better.
        """
        if self.interrupted:
            return Outcome.INTERRUPTED
        best = self.best if best is None else best
        doubt = functools.partial(doubt_of, self.problem, best)
        flat = functools.partial(is_flat, self.problem)
        return outcome_of(self.problem, best, self.ended.converged, doubt, flat)

    def note(self, u: np.ndarray) -> None:
        u = np.clip(np.array(u, dtype=float), 0.0, 1.0)
        known = self.problem.evaluations.get(u)
        if known is None:
            self.now.update()
            return
        value = self.problem.sense * self.problem.objective(known).value
        excess = self.problem.excess(known)
        measures = {name: known.values[name] for name in self.problem.wanted}
        named, beyond = self.problem.variables.by_name(u), known.beyond_range
        self.history.append(Iteration(named, value, excess, measures, beyond))
        missed = f", requirements missed by {excess:.1e}" if excess > 0.0 else ""
        self.now.update(found=f"objective {value:.6g}{missed}")


def outcome_of(
    problem: DesignProblem,
    best: Design,
    converged: bool,
    doubt: Callable[[], str],
    flat: Callable[[], bool],
) -> Outcome:
    """How runs that were not interrupted ended; what is asked last is asked only then."""
    if problem.excess(best.known) > problem.allowance(best.known):
        return Outcome.INFEASIBLE
    if any(problem.weights.get(name) for name in best.known.beyond_range):
        return Outcome.BEYOND_RANGE
    if not converged:
        return Outcome.UNFINISHED
    if doubt():
        return Outcome.CORNER
    return Outcome.FLAT if flat() else Outcome.CONVERGED


def rank_of(problem: DesignProblem, design: Design) -> tuple[float, float]:
    """Designs nearer to the requirements come first, and of those that keep them the better."""
    excess = problem.excess(design.known)
    return 0.0 if excess <= KEPT else excess, problem.objective(design.known).value


def _message(problem: DesignProblem, best: Design, ended: RunEnding, doubt: str) -> str:
    """The optimiser's own words, a doubt, and which bifurcations the best design does not meet."""
    ensemble, none = problem.ensemble, list[str]()
    if beyond := best.known.beyond_range:
        low, high = range_of(problem.scene_at(best.u), "slope")
        none = [f"{name}: none from {low:.6g} to {high:.6g} rad." for name in beyond]
    worst = [ensemble.words] if ensemble and ensemble.criterion == "worst" else []
    return " ".join(filter(None, [ended.message, doubt, *worst, *none]))


def doubt_of_gait(search: Search, critical: Bifurcation) -> str:
    """Why an optimum's own gait leaves it uncertain; empty where it does not."""
    if search is not Search.FOUND:
        return f"Its gait, searched again from where it was, ends as {search!s}."
    if critical is Bifurcation.FOLD:
        return "Its gait is at a fold, where derivatives have no bound."
    return ""


def optimum_of(
    problem: DesignProblem, runs: Runs, best: Design | None = None, gait: Gait | None = None
) -> Optimum:
    """The best of the designs that runs came to, or a given one, whose gait may be known."""
    best = restored(problem, runs.best) if best is None else best
    found, scene = problem.objective(best.known), problem.scene_at(best.u)
    gait = problem.settings.find_near(scene, best.known.state) if gait is None else gait
    outcome = runs.outcome(best)
    known = optimality_of(problem, best)
    objectives = {**OBJECTIVES, **with_parts(problem.wanted)}
    named = [name for name in best.known.values if name in objectives]
    doubt = doubt_of(problem, best) if outcome is Outcome.CORNER else ""
    if outcome in (Outcome.CONVERGED, Outcome.FLAT):
        doubt = doubt_of_gait(gait.outcome, gait.critical)
        outcome = Outcome.CORNER if doubt else outcome
    unknown = f"The search ended as {outcome!s}, so derivatives of an optimum are not known."
    unknown = "" if outcome is Outcome.CONVERGED else unknown
    return Optimum(
        outcome=outcome,
        message=_message(problem, best, runs.ended, doubt),
        scene=scene,
        gait=gait,
        variables=problem.variables.by_name(best.u),
        objective=problem.sense * found.value,
        # What holds it is known to an error, too, which the objective would gain by.
        error=found.error + sum(abs(held.multiplier) * held.error for held in known.requirements),
        known=best.known,
        curvature=curvature_of(problem, best) if outcome is Outcome.CONVERGED else None,
        sensitivities=sensitivities_of(problem, best, named, unknown),
        quantities={name: objectives[name].quantity for name in named},
        optimality=known,
        history=runs.history,
        evaluations=problem.evaluations.count,
        lost=problem.lost,
        unmeasured=problem.unmeasured,
        problem=problem,
        formulation=runs.formulation,
    )


def scattered_designs(problem: DesignProblem, begin: Design, count: int, seed: int) -> list[Design]:
    """The best of many scattered designs, those that keep the requirements before all others."""
    from scipy.stats import qmc

    u = qmc.Sobol(len(begin.u), seed=seed).random(_DRAWN * count)
    found: list[Design] = []
    for each, point in zip(u, follow_designs(problem, begin, u), strict=True):
        if not np.all(np.isfinite(point)):
            continue
        known = problem.evaluations.get(each) or problem.from_guess(each, point)
        if known is not None:
            found.append(Design(each, known))
    return sorted(found, key=lambda design: rank_of(problem, design))[:count]


def follow_designs(problem: DesignProblem, begin: Design, u: np.ndarray) -> np.ndarray:
    """States of the gaits of designs (n, k) on the section, shape (n, m); NaN where lost."""
    return _followed(problem.variables, begin, u, functools.partial(_gaits_of_designs, problem))


def _followed(
    variables: Variables,
    begin: Design,
    u: np.ndarray,
    gaits: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """By the derivatives of gaits that are found in some stages on the way."""
    known = begin.known
    points, slopes = (
        np.broadcast_to(each, (len(u), *each.shape)) for each in (known.state, known.state_slopes)
    )
    before = np.broadcast_to(begin.u, u.shape)
    for share in np.linspace(0.0, 1.0, _STAGES + 1)[1:]:
        here = begin.u + share * (u - begin.u)
        moves = variables.values(here) - variables.values(before)
        points = points + np.einsum("nmk,nk->nm", slopes[:, :, variables.places], moves)
        points, slopes = gaits(here, points)
        before = here
    return points


def _gaits_of_designs(
    problem: DesignProblem, u: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gaits of designs near guesses, and their derivatives (n, m, p); NaN where there are none."""
    columns, names = problem.variables.values(u), problem.variables.names
    every = [dict(zip(names, row, strict=True)) for row in columns.tolist()]
    allowed = np.asarray([allows(problem.scene, values) for values in every])
    own = np.where(allowed[:, None], columns, columns[np.argmax(allowed)])
    known = np.isfinite(points)
    values = dict(zip(names, own.T, strict=True))
    starts = np.where(known, points, 0.0)
    _, gaits, _ = gaits_near(problem.scene, values, starts, problem.settings)
    good = are_walks(gaits) & allowed & np.all(known, axis=1)
    found, slopes = (
        np.stack(recurring_leaves(states), axis=1)
        for states in (gaits.measures.state, gaits.sensitivities.state)
    )
    lost = ~good[:, None]
    return np.where(lost, np.nan, found), np.where(lost[:, None], np.nan, slopes)
