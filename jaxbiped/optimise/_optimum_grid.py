"""Optima over a grid of fixed numbers, followed from point to point in waves.

The derivatives of an optimum predict those of its neighbours. From there Newton's method solves the
equations of optimality with the second derivatives of the optimum before. The gaits of all points
of a wave are found as one batch, and each point is certified as any other optimum is.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import jax.tree_util as jtu
import numpy as np

from jaxbiped._progress import Stage, stage
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._design_functions import restored
from jaxbiped.optimise._design_gaits import gaits_near
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._objective_values import Evaluations
from jaxbiped.optimise._optimality import (
    SecondDerivatives,
    balance_of,
    doubt_of,
    places_beside,
    scale_at,
    second_derivatives_of,
)
from jaxbiped.optimise._optimisers import RunEnding
from jaxbiped.optimise._optimum import Outcome
from jaxbiped.optimise._optimum_sensitivities import (
    OptimalityEquations,
    doubt_of_derivatives,
    optimality_equations,
)
from jaxbiped.optimise._requirements import Requirement
from jaxbiped.optimise._runs import Runs, doubt_of_gait
from jaxbiped.scene._parameter_access import with_parameters

_BATCH = 16
"""Gaits that are sought at once: the number is a part of the compiled program."""
_STEPS, _CONVERGED, _LONGEST = 8, 3e-7, 0.3
"""Newton's steps of a point at most, and their lengths in u at the end and at most."""
_REACH = (1, 2)
"""Distances on the grid from which a point is predicted, the nearer ones first."""
_ITERATIONS = 60
"""Iterations of the trust region where Newton's method does not end at an optimum."""
Place: TypeAlias = tuple[int, ...]


class GridPoint(NamedTuple):
    """The optimum at a point of a grid.

    Attributes:
        problem, design: what it is the optimum of, and where it was found.
        outcome, message: as of an `Optimum`.
        second, equations: its second derivatives, and what determines it; None if there are none.
    """

    problem: DesignProblem
    design: Design
    outcome: Outcome
    message: str
    second: SecondDerivatives | None
    equations: OptimalityEquations | None


def grid_point(problem: DesignProblem, design: Design, outcome: Outcome, message: str) -> GridPoint:
    """The optimum with its derivatives where it has some."""
    second = second_derivatives_of(problem, design) if outcome is Outcome.CONVERGED else None
    if second is None or doubt_of_derivatives(second):
        return GridPoint(problem, design, outcome, message, None, None)
    equations = optimality_equations(problem, design, second)
    return GridPoint(problem, design, outcome, message, second, equations)


class OptimumGrid:
    """A grid of design problems, and the optima that are known of it.

    Attributes:
        base: the problem without what the grid asks for.
        axes: values by parameter or measure; `parameters` are the names of parameters among them,
            and `places` where these are among all parameters.
        points: optima so far, by place.
        tried: places that were tried from optima so far away.
    """

    def __init__(self, base: DesignProblem, axes: Mapping[str, np.ndarray]) -> None:
        self.base, self.axes = base, axes
        self.parameters = [name for name in axes if name in base.variables.fixed]
        chosen = [base.variables.fixed.index(name) for name in self.parameters]
        self.places = base.variables.fixed_places[chosen]
        self.points: dict[Place, GridPoint] = {}
        self.tried: dict[int, set[Place]] = {reach: set() for reach in _REACH}

    @property
    def shape(self) -> Place:
        return tuple(map(len, self.axes.values()))

    def values_at(self, place: Place) -> dict[str, float]:
        return {n: float(v[i]) for (n, v), i in zip(self.axes.items(), place, strict=True)}

    def fixed_name(self, axis: str) -> str:
        """What an axis is called among the fixed numbers of `Sensitivities`."""
        return axis if axis in self.parameters else f"bound of {axis}"

    def problem_at(self, place: Place) -> DesignProblem:
        values = self.values_at(place)
        scene = with_parameters(self.base.scene, {name: values[name] for name in self.parameters})
        bounds = (Requirement(n, x, x) for n, x in values.items() if n not in self.parameters)
        return self.base.variant(scene, (*self.base.requirements, *bounds), Evaluations())

    def follow(self, now: Stage) -> None:
        """Goes on from the optima that are known to all that can be reached."""
        wave = [(place, place) for place in self.points]
        while wave:
            pursuits = [_Pursuit(self, place, origin) for place, origin in wave]
            for point in pursue(pursuits):
                now.update(point.place not in self.points)
                self.points[point.place] = point.certified()
            wave = self._wave()

    def _wave(self) -> list[tuple[Place, Place]]:
        """Places that were not tried from so near, each with the place it is predicted from."""
        for reach, tried in self.tried.items():
            wave: dict[Place, Place] = {}
            for origin in self.points:
                for place in _places_about(origin, self.shape, reach):
                    if place not in self.points and place not in tried:
                        wave.setdefault(place, origin)
            tried |= wave.keys()
            if wave:
                return list(wave.items())
        return []


def _places_about(place: Place, shape: Place, distance: int) -> list[Place]:
    """Places of a grid that lie so many steps away."""
    every = itertools.product(range(-distance, distance + 1), repeat=len(shape))
    moves = [move for move in every if sum(map(abs, move)) == distance]
    places = [tuple(i + j for i, j in zip(place, move, strict=True)) for move in moves]
    return [at for at in places if all(0 <= i < n for i, n in zip(at, shape, strict=True))]


class _Pursuit:
    """The optimum of a place, pursued from that of another one.

    Attributes:
        place, problem: what is sought; in `pinned`, what holds the other optimum is an equality.
        u: the next design, or the last one where Newton's method has ended.
        gait: of the last design; None where it has none.
        step: length in u of the last step; NaN if the method cannot go on.
    """

    def __init__(self, grid: OptimumGrid, place: Place, origin: Place) -> None:
        self.place, self.problem, self.source = place, grid.problem_at(place), grid.points[origin]
        self.u, self.step = self.source.design.u, np.inf
        self.gait: Gait | None = None
        before, after = grid.values_at(origin), grid.values_at(place)
        moves = {name: after[name] - before[name] for name in grid.axes}
        held = set[str]()
        if self.source.equations is not None and self.source.second is not None:
            names, balance = self.source.equations.names, self.source.second.balance
            columns = [names.index(grid.fixed_name(name)) for name in moves]
            right = self.source.equations.by_fixed[:, columns] @ list(moves.values())
            step = np.linalg.solve(self.source.equations.by_variables, right)
            self.u = np.clip(self.u - step, 0.0, 1.0)
            rows = zip(balance.active, balance.holds, strict=False)
            held = {row.name for (row, _), holds in rows if holds}
        pinned = tuple(_pinned(each, held) for each in self.problem.requirements)
        self.pinned = self.problem.variant(self.problem.scene, pinned, self.problem.evaluations)
        self._fixed = {name: after[name] for name in grid.parameters}
        changes = np.array([moves[name] for name in grid.parameters])
        self._change = self.source.design.known.state_slopes[:, grid.places] @ changes

    @property
    def design(self) -> Design:
        """The last design."""
        assert self.problem.latest is not None
        return self.problem.latest

    @property
    def has_converged(self) -> bool:
        return bool(self.step <= _CONVERGED)

    def trial(self) -> "_Trial":
        here, change = self.problem.latest, np.zeros(len(self._change))
        if here is None:
            here, change = self.source.design, self._change
        expected = self.problem.expected_state(here, self.u, change)
        return _Trial(self.problem, self._fixed, self.u, *expected)

    def trials_beside(self) -> "list[_Trial]":
        """Designs beside the last one, whose gradients second derivatives compare."""
        design, scale = self.design, scale_at(self.problem, self.design)
        lines = balance_of(self.problem, design, scale).open_directions.T
        places = [u for line in lines for u in places_beside(design.u, line)]
        fixed, expected = self._fixed, self.problem.expected_state
        return [_Trial(self.problem, fixed, u, *expected(design, u)) for u in places]

    def advance(self, gait: Gait | None) -> None:
        """Newton's step from the design whose gait was just found, if it was."""
        self.gait, self.step = gait, np.nan
        if gait is None or self.problem.at(self.u) is None or self.source.second is None:
            return
        design, second = self.design, self.source.second
        scale = scale_at(self.pinned, design)
        balance = balance_of(self.pinned, design, scale)
        if len(second.slopes) + np.sum(balance.holds) != len(self.u):
            return
        share = scale_at(self.source.problem, self.source.design) / scale
        second = second._replace(balance=balance, slopes=share * second.slopes)
        equations = optimality_equations(self.pinned, design, second)
        move, *_ = np.linalg.lstsq(equations.by_variables, -equations.values)
        self.step = float(np.max(np.abs(move)))
        if self.step > _LONGEST:
            self.step = np.nan
        elif not self.has_converged:
            self.u = np.clip(self.u + move, 0.0, 1.0)

    def certified(self) -> GridPoint:
        """The optimum that this came to, or that the trust region finds from the last design."""
        problem, design = self.problem, self.design
        with stage("optimising the gait", unit="iterations") as now:
            runs = Runs(problem, _ITERATIONS, "trust-region", now)
        if self.has_converged:
            runs.ended = RunEnding(True, "Newton's steps became small.")
            for trial in self.trials_beside()[:1]:
                problem.at(trial.u)  # it shows whether derivatives tell how designs differ
        if not self.has_converged or runs.outcome(design) is not Outcome.CONVERGED:
            runs.run(design)
            design = restored(problem, runs.best)
            self.gait = problem.settings.find_near(problem.scene_at(design.u), design.known.state)
        outcome, doubt, message = runs.outcome(design), "", runs.ended.message
        if outcome is Outcome.CORNER:
            doubt = doubt_of(problem, design)
        elif outcome is Outcome.CONVERGED and self.gait is not None:
            doubt = doubt_of_gait(self.gait.outcome, self.gait.critical)
            outcome = Outcome.CORNER if doubt else outcome
        return grid_point(problem, design, outcome, " ".join(filter(None, [message, doubt])))


def _pinned(requirement: Requirement, held: set[str]) -> Requirement:
    """The requirement as an equality where it is one of those that are held."""
    name, low, high = requirement
    if name not in held or None not in (low, high):
        return requirement
    return Requirement(name, high if low is None else low, low if high is None else high)


def pursue(points: list[_Pursuit]) -> list[_Pursuit]:
    """Newton's method of all points at once; those that have a design."""
    under_way = points
    for _ in range(_STEPS):
        gaits = _find_gaits([point.trial() for point in under_way])
        for point, gait in zip(under_way, gaits, strict=True):
            point.advance(gait)
        under_way = [point for point in under_way if point.step > _CONVERGED]
    there = [point for point in points if point.has_converged]
    _find_gaits([trial for point in there for trial in point.trials_beside()])
    return [point for point in points if point.problem.latest is not None]


class _Trial(NamedTuple):
    """A design whose gait is sought near an expected state, which it may miss by so much.

    `fixed` are the parameters in which its scene differs from others beside the variables.
    """

    problem: DesignProblem
    fixed: dict[str, float]
    u: np.ndarray
    state: np.ndarray
    farthest: np.ndarray


def _find_gaits(trials: Sequence[_Trial]) -> list[Gait | None]:
    """The gaits of designs in batches, whose evaluations are kept; None where there is none."""
    gaits: list[Gait | None] = []
    for begin in range(0, len(trials), _BATCH):
        chunk = trials[begin : begin + _BATCH]
        filled = [*chunk, *[chunk[0]] * (_BATCH - len(chunk))]
        rows = [trial.fixed | trial.problem.variables.by_name(trial.u) for trial in filled]
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        base, states = chunk[0].problem, np.array([trial.state for trial in filled])
        batch = gaits_near(base.scene, columns, states, base.settings, base.wanted)
        for k, trial in enumerate(chunk):
            scene, gait, functionals = jtu.tree_map(lambda leaf, k=k: leaf[k], batch)
            near = trial.state, trial.farthest
            known = trial.problem.keep(trial.u, scene, gait, *near, functionals)
            gaits.append(None if known is None else gait)
    return gaits
