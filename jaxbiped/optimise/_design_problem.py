"""Design problem: variables, requirements and objective, whose gaits are found anew.

A gait is sought from where the last one's derivatives point; where that fails, or leads to another
branch, it is followed there in smaller steps. Every design is evaluated once and kept.
"""

import functools
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._gait import Gait
from jaxbiped.gait._search_provenance import explain_search
from jaxbiped.optimise._cycle_functionals import Functional, weighted_sum
from jaxbiped.optimise._design_gaits import (
    Ensemble,
    GaitSettings,
    are_walks,
    evaluate_ensemble,
    evaluate_members,
    with_worse_members,
)
from jaxbiped.optimise._jacobian_functionals import CLUSTER
from jaxbiped.optimise._objective_values import (
    AllFunctionals,
    Evaluation,
    Evaluations,
    evaluate,
    jacobian_names,
)
from jaxbiped.optimise._objectives import (
    Measures,
    measures_named,
)
from jaxbiped.optimise._requirements import Requirement
from jaxbiped.scene._parameter_access import parameter_names, parameter_values, with_parameters
from jaxbiped.scene._scene import WalkerScene
from jaxbiped.scene._state_types import WalkerState

KEPT = 1e-6
"""Part of its bound by which a requirement may be missed and still counts as kept, at least."""
_SMALLEST = 1.0 / 32.0
"""Share of the way to a design below which no step is tried: its gait is given up."""
_FLOOR, _ASIDE, _NEAR = 0.1, 0.5, 0.02
"""Size below which components of the state count as of one size; how far aside, in units of the
step, and how far at least, relative to it, a gait may lie from where it was expected."""


class Variables(NamedTuple):
    """k design variables; u in [0, 1] is linear in a parameter, or in its logarithm.

    Attributes:
        names: of the parameters.
        low, high: their bounds, shape (k,).
        logarithmic: where u is linear in the logarithm (booleans): where both bounds are positive.
        places: of the variables among all parameters of the scene, shape (k,).
        fixed: names of the parameters that are not varied.
    """

    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    logarithmic: np.ndarray
    places: np.ndarray
    fixed: tuple[str, ...]

    @property
    def fixed_places(self) -> np.ndarray:
        """Places of the parameters that are not varied, in the order of `fixed`."""
        every = np.arange(len(self.names) + len(self.fixed))
        return np.setdiff1d(every, self.places)

    def values(self, u: np.ndarray) -> np.ndarray:
        """Parameters at u, shape (…, k); at 0 and 1 the bounds exactly."""
        geometric = self.low * self._ratio(1.0) ** u
        values = np.where(self.logarithmic, geometric, self.low + u * (self.high - self.low))
        return np.where(u <= 0.0, self.low, np.where(u >= 1.0, self.high, values))

    def rates(self, u: np.ndarray) -> np.ndarray:
        growth = self.values(u) * np.log(self._ratio(1.0))
        return np.where(self.logarithmic, growth, self.high - self.low)

    def positions(self, values: np.ndarray) -> np.ndarray:
        """The u of parameters, those outside the bounds moved onto them, shape (k,)."""
        within = np.clip(values, self.low, self.high)
        part = np.where(self.logarithmic, within, 1.0) / np.where(self.logarithmic, self.low, 1.0)
        geometric = np.log(part) / np.log(self._ratio(np.exp(1.0)))
        linear = (within - self.low) / (self.high - self.low)
        return np.clip(np.where(self.logarithmic, geometric, linear), 0.0, 1.0)

    def _ratio(self, otherwise: float) -> np.ndarray:
        """The upper bound over the lower where u is linear in the logarithm."""
        logarithmic = self.logarithmic
        return np.where(logarithmic, self.high, otherwise) / np.where(logarithmic, self.low, 1.0)

    def by_name(self, u: np.ndarray) -> dict[str, float]:
        return dict(zip(self.names, self.values(u).tolist(), strict=True))


def variables_of(scene: Any, vary: Mapping[str, tuple[float, float]]) -> Variables:
    """The variables that a mapping from names to bounds describes.

    Raises:
        ArgumentError: there is no variable, one is unknown, or bounds are empty or not allowed.
    """
    if not isinstance(vary, Mapping) or not vary:
        raise ArgumentError(
            f"vary = {vary!r} is not allowed: it must map at least one parameter to its bounds, "
            "such as {'d': (0.05, 0.2)}."
        )
    names = parameter_names(scene)
    for name, bounds in vary.items():
        check_choice("vary", name, names)
        if np.shape(bounds) != (2,):
            raise ArgumentError(f"bounds of {name} = {bounds!r} are not allowed: give (low, high).")
        check_finite(f"bounds of {name}", bounds)
        low, high = bounds
        if not low < high:
            raise ArgumentError(
                f"bounds of {name} = ({low:g}, {high:g}) are empty: low must be below high."
            )
        for bound in bounds:
            with_parameters(scene, {name: bound})
    lows, highs = np.asarray([vary[name] for name in vary], dtype=float).T
    return Variables(
        names=tuple(vary),
        low=lows,
        high=highs,
        logarithmic=lows > 0.0,
        places=np.asarray([names.index(name) for name in vary]),
        fixed=tuple(name for name in names if name not in vary),
    )


def start_of(scene: Any, variables: Variables) -> np.ndarray:
    """The scene's own design in u, moved into the bounds, shape (k,)."""
    own = parameter_values(scene)
    return variables.positions(np.asarray([float(own[name]) for name in variables.names]))


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
        wanted: all measures that play a part, by name.
        evaluations: of all designs so far.
        ensemble: over whose members measures are taken; None for the design alone.
        latest: the last design whose gait was found; `asked` all of them, in order.
        first_gait: that of the design to start from, if it was not known from a store.
        lost: how often a design had none, or no measure of it.
        unmeasured: gaits that were found and have a measure that is not finite.
    """

    def __init__(
        self,
        scene: Any,
        variables: Variables,
        told: Mapping[str, float],
        sense: float,
        requirements: tuple[Requirement, ...],
        wanted: Measures,
        settings: GaitSettings,
        evaluations: Evaluations,
        ensemble: Ensemble | None = None,
    ) -> None:
        self.scene, self.variables = scene, variables
        self.sense, self.requirements = sense, requirements
        self.weights = {name: sense * weight for name, weight in told.items()}
        self.settings, self.evaluations, self.ensemble = settings, evaluations, ensemble
        self.wanted = wanted
        self.latest: Design | None = None
        self.first_gait: Gait | None = None
        self.asked: list[Design] = []
        self.lost = self.unmeasured = 0

    def variant(
        self,
        scene: Any,
        *,
        variables: Variables | None = None,
        requirements: tuple[Requirement, ...] | None = None,
        without: Collection[str] = (),
    ) -> "DesignProblem":
        """The same problem for another scene, `without` some measures, nothing evaluated yet."""
        held = self.requirements if requirements is None else requirements
        return DesignProblem(
            scene,
            self.variables if variables is None else variables,
            {name: self.sense * w for name, w in self.weights.items() if name not in without},
            self.sense,
            tuple(each for each in held if each.name not in without),
            {name: each for name, each in self.wanted.items() if name not in without},
            self.settings,
            Evaluations(),
            self.ensemble,
        )

    @functools.cached_property
    def has_cluster(self) -> bool:
        """Whether functionals of multipliers are of one gait, not means over an ensemble."""
        of_one = self.ensemble is None or self.ensemble.criterion != "mean"
        return of_one and bool(jacobian_names(self.scene, measures_named(CLUSTER[:1])))

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
            known, self.first_gait = self._keep(u, scene, gait), gait
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
        scene, wanted = self.scene_at(design.u), self.wanted

        def evaluate(tried: Ensemble) -> list[Evaluation | None]:
            return evaluate_members(tried, scene, design.known, wanted, self.settings)

        return with_worse_members(self.ensemble, evaluate, wanted, seed)

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
        known = self.beside(u)
        if known is None:
            self.lost += 1
            return None
        return self._note(u, known).known

    def beside(self, u: np.ndarray) -> Evaluation | None:
        """The same of a design that is looked at, and none of those that are asked for."""
        known = self.evaluations.get(u)
        if known is None and not self.evaluations.is_lost(u):
            known = self._follow(np.array(u))
            if known is None:
                self.evaluations.add(u, None)
        return None if known is None or not self._has_derivatives(known) else known

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
        return self.keep(u, scene, self.settings.find_near(scene, guess), guess, farthest)

    def keep(
        self,
        u: np.ndarray,
        scene: WalkerScene,
        gait: Gait,
        guess: np.ndarray,
        farthest: np.ndarray | float = np.inf,
        functionals: AllFunctionals | None = None,
    ) -> Evaluation | None:
        """What is known of a design whose gait was sought near a guess; None if it has none there.

        `functionals` are those of its measures, where they are known.
        """
        if not are_walks(gait):
            return None
        away = np.abs(np.stack(recurring_leaves(gait.measures.state)) - guess)
        return None if np.any(away > farthest) else self._keep(u, scene, gait, functionals)

    def scene_at(self, u: np.ndarray) -> WalkerScene:
        """The scene of a design; raises `ArgumentError` where parameters do not go together."""
        return with_parameters(self.scene, self.variables.by_name(u))

    def _keep(
        self,
        u: np.ndarray,
        scene: WalkerScene,
        gait: Gait,
        functionals: AllFunctionals | None = None,
    ) -> Evaluation | None:
        if self.ensemble is None:
            known = evaluate(scene, gait, self.wanted, self.settings.accuracy, functionals)
        else:
            nominal = evaluate(scene, gait, {}, self.settings.accuracy)
            members = evaluate_ensemble(self.ensemble, scene, nominal, self.wanted, self.settings)
            if members is None:
                return None
            known = members
        known_slopes = np.all(np.isfinite(known.state_slopes[:, self.variables.places]))
        if not known_slopes or not all(np.isfinite(known.values[name]) for name in self.wanted):
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
        return self.from_guess(u, *self.expected_state(here, u))

    def expected_state(
        self, here: Design, u: np.ndarray, move: np.ndarray | float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """The state of a design's gait near another's, and how far it may lie aside, shape (m,).

        `move` is the state's change with what differs beside the variables.
        """
        before, after = (self.variables.values(each) for each in (here.u, u))
        move = move + here.known.state_slopes[:, self.variables.places] @ (after - before)
        sizes = _FLOOR + np.abs(here.known.state)
        length = np.max(np.abs(move) / sizes)
        return here.known.state + move, (_ASIDE * length + _NEAR) * sizes


def scale_of(bound: float) -> float:
    """The size of a bound, one for zero."""
    return abs(bound) if bound != 0.0 else 1.0
