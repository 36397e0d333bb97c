"""Optima over a grid of fixed numbers, followed from point to point in waves.

The derivatives of an optimum predict those of its neighbours. From there Newton's method solves the
conditions of optimality with the second derivatives of the optimum before. The gaits of all points
of a wave are found as one batch, and each point is certified as any other optimum is.
"""

import contextlib
import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._progress import Stage, stage
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._design_functions import restored
from jaxbiped.optimise._design_gaits import gaits_near
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._optimality import (
    balance_of,
    places_beside,
    scale_at,
    second_derivatives_of,
)
from jaxbiped.optimise._optimisers import RunEnding
from jaxbiped.optimise._optimum import Optimum, Outcome
from jaxbiped.optimise._optimum_sensitivities import newton_step
from jaxbiped.optimise._requirements import Requirement
from jaxbiped.optimise._runs import Runs, optimum_of
from jaxbiped.scene._parameter_access import with_parameters

_BATCH = 16
"""Gaits that are sought at once: the number is a part of the compiled program."""
_ROUNDS, _STEPS, _SHORT, _LONG, _KEPT = 3, 4, 3e-7, 0.3, 1e-10
"""Second derivatives with which Newton's method goes on at most, and steps with each; lengths of
the steps in u at the end, and at most; and by what part of a bound requirements are missed then."""
_ITERATIONS = 60
"""Iterations of the trust region where Newton's method does not end at an optimum."""
Place: TypeAlias = tuple[int, ...]


class GridPoint(NamedTuple):
    """An optimum, whose gait has no orbit, and the design of the problem that it is."""

    problem: DesignProblem
    design: Design
    optimum: Optimum


class OptimumGrid:
    """A grid of design problems, and the optima that are known of it.

    Attributes:
        base: the problem without what the grid asks for.
        axes: values by parameter or measure.
        parameters: those of the axes that are parameters.
        points: optima so far, by place; `lost` places from which none was reached.
    """

    def __init__(self, base: DesignProblem, axes: Mapping[str, np.ndarray]) -> None:
        self.base, self.axes = base, axes
        self.parameters = [name for name in axes if name in base.variables.fixed]
        self.points: dict[Place, GridPoint] = {}
        self.lost: set[Place] = set()

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
        return self.base.variant(scene, requirements=(*self.base.requirements, *bounds))

    def follow(self, now: Stage) -> None:
        """Improves the optima that are known, and goes on from them to all other points."""
        wave = [(place, place) for place in self.points]
        while wave:
            pursuits = []
            for place, origin in wave:
                with contextlib.suppress(ArgumentError):  # parameters that do not go together
                    pursuits.append(_Pursuit(self, place, origin))
            for pursuit in pursue(pursuits):
                self.points[pursuit.place] = pursuit.certified()
            self.lost |= {place for place, _ in wave} - self.points.keys()
            now.update(len(wave), found=f"{len(self.points)} optima")
            wave = self._wave()

    def _wave(self) -> list[tuple[Place, Place]]:
        """The points that lie nearest to known ones, each with the one that it lies nearest to."""
        every = (tuple(map(int, place)) for place in np.ndindex(self.shape))
        left = [place for place in every if place not in self.points and place not in self.lost]
        if not left:
            return []
        origins = list(self.points)
        away = np.sum(np.abs(np.array(left)[:, None] - np.array(origins)), axis=2)
        nearest, closest = np.argmin(away, axis=1), np.min(away, axis=1)
        pairs = zip(left, nearest, closest, strict=True)
        return [(place, origins[k]) for place, k, steps in pairs if steps == np.min(closest)]


class _Trial(NamedTuple):
    """A design whose gait is sought near an expected state, which it may miss by so much.

    `fixed` are the parameters in which its scene differs from others beside the variables.
    """

    problem: DesignProblem
    fixed: dict[str, float]
    u: np.ndarray
    state: np.ndarray
    farthest: np.ndarray


class _Pursuit:
    """The optimum of a place, pursued from that of another one.

    Attributes:
        place, problem: what is sought.
        u: the next design, or the last one where Newton's method has ended.
        gait: of the last design; None where it has none.
        has_converged: whether Newton's method has ended at `u`; `is_over` where it cannot go on.
    """

    def __init__(self, grid: OptimumGrid, place: Place, origin: Place) -> None:
        problem, (owner, design, optimum) = grid.problem_at(place), grid.points[origin]
        self.place, self.problem = place, problem
        self.has_converged = self.is_over = False
        self.gait: Gait | None = None
        before, after = grid.values_at(origin), grid.values_at(place)
        moves, known = np.array([after[n] - before[n] for n in grid.axes]), optimum.sensitivities
        self.u, self._second = design.u, None
        if not known.message:
            self._second = second_derivatives_of(owner, design)
            columns = [known.parameters.index(grid.fixed_name(name)) for name in grid.axes]
            change = np.array([known.variables[n][columns] for n in problem.variables.names])
            values = np.array(list(optimum.variables.values())) + change @ moves
            self.u = np.where(np.any(change, axis=1), problem.variables.positions(values), self.u)
        fixed, slopes = problem.variables.fixed, design.known.state_slopes
        places = [problem.variables.fixed_places[fixed.index(name)] for name in grid.parameters]
        own = [moves[list(grid.axes).index(name)] for name in grid.parameters]
        self._origin, self._move = design, slopes[:, places] @ np.array(own)
        self._fixed = {name: after[name] for name in grid.parameters}

    @property
    def design(self) -> Design:
        """The last design."""
        assert self.problem.latest is not None
        return self.problem.latest

    def trial(self) -> _Trial:
        """The next design."""
        latest, expected = self.problem.latest, self.problem.expected_state
        here = (self._origin, self.u, self._move) if latest is None else (latest, self.u)
        return _Trial(self.problem, self._fixed, self.u, *expected(*here))

    def trials_beside(self) -> list[_Trial]:
        """Designs beside the last one, whose gradients second derivatives compare."""
        design, expected = self.design, self.problem.expected_state
        balance = balance_of(self.problem, design, scale_at(self.problem, design))
        lines = balance.open_directions.T
        places = [u for line in lines for u in places_beside(design.u, line)]
        return [_Trial(self.problem, self._fixed, u, *expected(design, u)) for u in places]

    def advance(self, gait: Gait | None) -> None:
        """Newton's step from the design whose gait was just found, if it was."""
        self.gait, self.is_over = gait, True
        if gait is None or self.problem.at(self.u) is None or self._second is None:
            return
        move = newton_step(self.problem, self.design, self._second)
        length = float(np.max(np.abs(move)))
        is_kept = self.problem.excess(self.design.known) <= _KEPT
        self.has_converged = is_kept and length <= _SHORT
        self.is_over = self.has_converged or not length <= _LONG
        if not self.is_over:
            self.u = np.clip(self.u + move, 0.0, 1.0)

    def renew(self) -> None:
        """Goes on with second derivatives of the last design, where they are known."""
        second = second_derivatives_of(self.problem, self.design)
        if second is not None and np.all(np.isfinite(second.slopes)):
            self._second = second

    def certified(self) -> GridPoint:
        """The optimum that this came to, or that the trust region finds from the last design."""
        problem, design, gait = self.problem, self.design, self.gait
        with stage("optimising the gait", unit="iterations") as now:
            runs = Runs(problem, _ITERATIONS, "trust-region", now)
            if self.has_converged:
                runs.ended = RunEnding(True, "Newton's steps became small.")
                for trial in self.trials_beside()[:1]:
                    problem.at(trial.u)  # it shows whether derivatives tell how designs differ
            if not self.has_converged or runs.outcome(design) is not Outcome.CONVERGED:
                runs.run(design)
                design, gait = restored(problem, runs.best), None
            optimum = optimum_of(problem, runs, design, gait)
        gait = dataclasses.replace(optimum.gait, orbit=None)  # type: ignore[arg-type]
        return GridPoint(problem, design, dataclasses.replace(optimum, gait=gait))


def pursue(points: list[_Pursuit]) -> list[_Pursuit]:
    """Newton's method of all points at once; those that have a design."""
    under_way = points
    for _ in range(_ROUNDS):
        before = under_way
        for _ in range(_STEPS):
            gaits = _find_gaits([point.trial() for point in under_way])
            for point, gait in zip(under_way, gaits, strict=True):
                point.advance(gait)
            under_way = [point for point in under_way if not point.is_over]
        left = [point for point in before if point.has_converged or not point.is_over]
        _find_gaits([trial for point in left for trial in point.trials_beside()])
        for point in under_way:
            point.renew()
    return [point for point in points if point.problem.latest is not None]


def _find_gaits(trials: Sequence[_Trial]) -> list[Gait | None]:
    """The gaits of designs in batches, whose evaluations are kept; None where there is none."""
    gaits: list[Gait | None] = []
    for begin in range(0, len(trials), _BATCH):
        chunk = trials[begin : begin + _BATCH]
        filled = [*chunk, *[chunk[0]] * (_BATCH - len(chunk))]
        rows = [trial.fixed | trial.problem.variables.by_name(trial.u) for trial in filled]
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        base, states = chunk[0].problem, np.array([trial.state for trial in filled])
        try:
            batch = gaits_near(base.scene, columns, states, base.settings, base.wanted)
        except ArgumentError:  # parameters of one of them do not go together
            alone = [_find_gaits([trial]) for trial in chunk] if len(chunk) > 1 else [[None]]
            gaits += itertools.chain.from_iterable(alone)
            continue
        for k, trial in enumerate(chunk):
            scene, gait, functionals = jtu.tree_map(lambda leaf, k=k: leaf[k], batch)
            near = trial.state, trial.farthest
            known = trial.problem.keep(trial.u, scene, gait, *near, functionals)
            gaits.append(None if known is None else gait)
    return gaits
