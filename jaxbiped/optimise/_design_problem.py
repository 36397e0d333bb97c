"""Design problem: objective and requirements as functions of the variables, each gait found anew.

A gait is sought from where the last one's derivatives point; where that fails, or leads to another
branch, it is followed there in smaller steps. Every design is evaluated once and kept.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_provenance import explain_search
from jaxbiped.optimise._cycle_functionals import Functional, weighted_sum
from jaxbiped.optimise._design_gaits import (
    Ensemble,
    GaitSettings,
    are_walks,
    evaluate_ensemble,
    with_worse_members,
)
from jaxbiped.optimise._design_variables import Requirement, Variables
from jaxbiped.optimise._jacobian_functionals import CLUSTER
from jaxbiped.optimise._objective_values import Evaluation, Evaluations, evaluate
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._state_types import WalkerState

KEPT = 1e-6
"""Part of its bound by which a requirement may be missed and still counts as kept, at least."""
_SMALLEST = 1.0 / 32.0
"""Share of the way to a design below which no step is tried: its gait is given up."""
_FLOOR, _ASIDE, _NEAR = 0.1, 0.5, 0.02
"""Size below which components of the state count as of one size; how far aside, in units of the
step, and how far at least, relative to it, a gait may lie from where it was expected."""


class Design(NamedTuple):
    """A design whose gait is known: its u, shape (k,), and what is known of it."""

    u: np.ndarray
    known: Evaluation


class DesignProblem:
    """Minimise or maximise a weighted sum subject to requirements.

    Attributes:
        scene, variables: what is designed.
        sense: 1 where the sum of the measures is minimised, −1 where it is maximised.
        weights: of the measures in the sum that is minimised, by name.
        requirements: what must hold.
        evaluations: of all designs so far.
        ensemble: over whose members measures are taken; None for the design alone.
        latest: the last design whose gait was found; `asked` all of them, in order.
        lost: how often a design had none, or no measure of it.
        unmeasured: gaits that were found and have a measure that is not finite.
    """

    def __init__(
        self,
        scene: Scene | RigidScene,
        variables: Variables,
        told: Mapping[str, float],
        sense: float,
        requirements: tuple[Requirement, ...],
        settings: GaitSettings,
        evaluations: Evaluations,
        ensemble: Ensemble | None = None,
    ) -> None:
        self.scene, self.variables = scene, variables
        self.sense, self.requirements = sense, requirements
        self.weights = {name: sense * weight for name, weight in told.items()}
        self.settings, self.evaluations, self.ensemble = settings, evaluations, ensemble
        self.wanted = tuple(dict.fromkeys((*told, *(each.name for each in requirements))))
        self.latest: Design | None = None
        self.asked: list[Design] = []
        self.lost = self.unmeasured = 0

    @property
    def has_cluster(self) -> bool:
        """Whether multipliers are those of one gait, and not means over an ensemble."""
        return self.ensemble is None or self.ensemble.criterion != "mean"

    def begin(self, u: np.ndarray, guess: WalkerState | None = None) -> Design:
        """The first design; its gait is found near a guess, or from nothing.

        Raises:
            ArgumentError: no gait, or a measure that cannot be differentiated.
        """
        known = self.evaluations.get(u)
        if known is None:
            scene = self.scene_at(u)
            gait = self.settings.find(scene, guess)
            if not are_walks(gait):
                raise ArgumentError(
                    f"the design to start from has no gait: {explain_search(scene, gait)}."
                )
            known = self._keep(u, scene, gait)
        if known is None:
            raise ArgumentError(
                "the gait of the design to start from has a measure that is not finite: choose "
                f"others than {', '.join(self.wanted)}."
            )
        for name in self.wanted:
            if not np.all(np.isfinite(known.slopes[name][self.variables.places])):
                raise ArgumentError(
                    f"{name} cannot be optimised or bounded at the design to start from: its value "
                    f"there is {known.values[name]:g}, and it has no derivatives."
                )
        return self._note(u, known)

    def worse_ensemble(self, design: Design, seed: int) -> Ensemble | None:
        """The ensemble with members that are worse at a design; None where none are found."""
        if self.ensemble is None or self.ensemble.criterion == "mean":
            return None
        known = design.known
        return with_worse_members(
            self.ensemble, self.scene_at(design.u), known, self.wanted, self.settings, seed
        )

    def begin_again(self, design: Design, ensemble: Ensemble) -> Design:
        """That design with another ensemble, and no other.

        Raises as `begin`, and then leaves all as it was.
        """
        before = self.ensemble, self.asked, self.evaluations, self.latest
        self.ensemble, self.asked, self.evaluations = ensemble, [], Evaluations(None, {})
        self.evaluations.count = before[2].count
        try:
            return self.begin(design.u, self.settings.state_of(self.scene, design.known.state))
        except BaseException:
            self.ensemble, self.asked, self.evaluations, self.latest = before
            raise

    def at(self, u: np.ndarray) -> Evaluation | None:
        """What is known of a design; None without a gait on the way there, or derivatives of it."""
        known = self.evaluations.get(u)
        if known is None and not self.evaluations.is_lost(u):
            known = self._follow(np.array(u))
            if known is None:
                self.evaluations.add(u, None)
        if known is None or not self._has_derivatives(known):
            self.lost += 1
            return None
        return self._note(u, known).known

    def _has_derivatives(self, known: Evaluation) -> bool:
        """Whether those that are used are finite: bounded from above, the radius's own are not."""
        low = any(r.low is not None for r in self.requirements if r.name == CLUSTER[0])
        is_smooth = self.has_cluster and not low and self.weights.get(CLUSTER[0], 1.0) > 0.0
        names = {*self.wanted, *CLUSTER[1:]} & {*known.slopes} - {*CLUSTER[:is_smooth]}
        return all(np.all(np.isfinite(known.slopes[n][self.variables.places])) for n in names)

    def _note(self, u: np.ndarray, known: Evaluation) -> Design:
        self.latest = Design(np.array(u), known)
        self.asked.append(self.latest)
        return self.latest

    def objective(self, known: Evaluation, weights: dict[str, float] | None = None) -> Functional:
        """The sum that is minimised, or that of other weights."""
        weights = self.weights if weights is None else weights
        return weighted_sum(
            weights.values(), map(known.functional, weights), known.state_slopes.shape[1]
        )

    def gradient(self, u: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Derivatives with respect to u from those with respect to all parameters."""
        return slopes[..., self.variables.places] * self.variables.rates(u)

    def excess(self, known: Evaluation) -> float:
        """By how much the worst requirement is missed, relative to its bound; 0 if none is."""
        missed = [
            sign * (bound - known.values[each.name]) / scale_of(bound)
            for each in self.requirements
            for bound, sign in ((each.low, 1.0), (each.high, -1.0))
            if bound is not None
        ]
        return max([0.0, *missed])

    def allowance(self, known: Evaluation) -> float:
        """What of `excess` is within the error bars of the measures."""
        sizes = [
            known.errors[each.name] / scale_of(bound)
            for each in self.requirements
            for bound in (each.low, each.high)
            if bound is not None
        ]
        return max([KEPT, *sizes])

    def from_guess(
        self, u: np.ndarray, guess: np.ndarray, farthest: np.ndarray | float = np.inf
    ) -> Evaluation | None:
        """What is known of a design whose gait is near a guess, shape (m,); None where none is.

        No component is off by more than `farthest`.
        """
        try:
            scene = self.scene_at(u)
        except ArgumentError:  # parameters that do not go together
            return None
        gait = self.settings.find_near(scene, guess)
        if not are_walks(gait):
            return None
        found = np.stack(recurring_leaves(gait.measures.state))
        return None if np.any(np.abs(found - guess) > farthest) else self._keep(u, scene, gait)

    def scene_at(self, u: np.ndarray) -> Scene | RigidScene:
        """The scene of a design; raises `ArgumentError` where parameters do not go together."""
        return with_parameters(self.scene, self.variables.by_name(u))

    def _keep(self, u: np.ndarray, scene: Scene | RigidScene, gait: Gait) -> Evaluation | None:
        if self.ensemble is None:
            known = evaluate(scene, gait, self.wanted, self.settings.accuracy)
        else:
            nominal = evaluate(scene, gait, (), self.settings.accuracy)
            members = evaluate_ensemble(self.ensemble, scene, nominal, self.wanted, self.settings)
            if members is None:
                return None
            known = members
        if not all(np.isfinite(known.values[name]) for name in self.wanted):
            self.unmeasured += 1
            return None
        self.evaluations.add(u, known)
        return known

    def _follow(self, u: np.ndarray) -> Evaluation | None:
        """Gaits on the way from the latest design, or from the nearest known, in halved steps."""
        assert self.latest is not None
        here, done, step = Design(*self.evaluations.nearest(u)), 0.0, 1.0
        begin = here.u
        while step >= _SMALLEST:
            share = min(1.0, done + step)
            ahead = u if share == 1.0 else begin + share * (u - begin)
            known = self._next(here, ahead)
            if known is None:
                step *= 0.5
            elif share == 1.0:
                return known
            else:
                here, done = Design(ahead, known), share
        return None

    def _next(self, here: Design, u: np.ndarray) -> Evaluation | None:
        """The gait of a design near one whose gait is known, on the same branch."""
        before, after = (self.variables.values(each) for each in (here.u, u))
        move = here.known.state_slopes[:, self.variables.places] @ (after - before)
        sizes = _FLOOR + np.abs(here.known.state)
        length = np.max(np.abs(move) / sizes)
        return self.from_guess(u, here.known.state + move, (_ASIDE * length + _NEAR) * sizes)


def scale_of(bound: float) -> float:
    """The size of a bound, one for zero."""
    return abs(bound) if bound != 0.0 else 1.0
