"""Refinement: splines in time get more knots until the gap to free torques is small."""

import itertools
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from jaxbiped._checks import ArgumentError, check_count, check_positive, check_type
from jaxbiped._progress import Stage, stage
from jaxbiped.optimise._design_problem import Variables, variables_of
from jaxbiped.optimise._objectives import is_sum_of_parameters
from jaxbiped.optimise._optimum import Optimum
from jaxbiped.optimise._runs import Runs, optimum_of
from jaxbiped.optimise._simultaneous_search import begin_together, check_simultaneous
from jaxbiped.optimise._torque_gap import TorqueGap, coefficient_names, time_splines, torque_gap
from jaxbiped.scene.actuation._time_laws import TimeSpline

_SEGMENTS, _ITERATIONS = 7, 200
"""Segments and steps of each search."""


class Refinement(NamedTuple):
    """Optima with ever more knots.

    Attributes:
        optima: the given optimum, then that of each round.
        gaps: what torques that are free in time could still save at each of them.
    """

    optima: tuple[Optimum, ...]
    gaps: tuple[TorqueGap, ...]

    @property
    def best(self) -> Optimum:
        """The last optimum."""
        return self.optima[-1]


def refine(
    best: Optimum, *, gap: float = 1e-6, rounds: int = 4, progress: bool | None = None
) -> Refinement:
    """Halves the intervals of an optimum's splines in time until its torque gap is small enough.

    Each `TimeSpline` becomes the same function in twice as many intervals, and state, period and
    parameters are sought together from the optimum. The new coefficients have the widest bounds of
    the old ones.

    Args:
        best: the optimum to begin with; `torque_gap` says what is possible.
        gap: bound of the torque gap at which to stop, as a share of the objective.
        rounds: maximum number of rounds.
        progress: as for `optimise_gait`.

    Returns:
        The optima and their gaps. The last gap is above the requested one if the rounds were used
        up, for example because another motor has a law of another kind.

    Raises:
        ArgumentError: an argument is not allowed, no `TimeSpline` is varied or one is not varied
            as a whole, or the problem holds a sum of parameters.
    """
    check_type("best", best, Optimum)
    check_positive("gap", gap)
    check_count("rounds", rounds, 0)
    refined_laws(best)  # refused where there are none
    optima, gaps = [best], [torque_gap(best)]
    with stage("refining the torques", unit="iterations", show=progress) as now:
        while gaps[-1].bound > gap * abs(optima[-1].objective) and len(optima) <= rounds:
            optima.append(_sought(optima[-1], now))
            gaps.append(torque_gap(optima[-1]))
            now.update(found=f"torque gap {gaps[-1].bound:.2e} of {optima[-1].objective:.9g}")
    return Refinement(tuple(optima), tuple(gaps))


def _sought(best: Optimum, now: Stage) -> Optimum:
    """The optimum with finer splines, sought from the given one."""
    scene, variables = refined_laws(best)
    problem = best.problem.variant(scene, variables=variables)
    check_simultaneous(problem)
    known = best.gait.measures
    begin, ended = begin_together(
        problem, known.state, float(known.period), _SEGMENTS, _ITERATIONS, (0, 0), now
    )
    runs = Runs(problem, _ITERATIONS, "trust-region", now, "together")
    runs.run(begin, ended)
    return optimum_of(problem, runs)


def refined_laws(best: Optimum) -> tuple[Any, Variables]:
    """The optimum's scene with twice as many intervals of all splines in time, and its variables.

    Raises:
        ArgumentError: the splines cannot be refined.
    """
    names, low, high, *_ = best.problem.variables
    vary = dict(zip(names, zip(low.tolist(), high.tolist(), strict=True), strict=True))
    splines, coefficients = time_splines(best.scene), coefficient_names(best.scene, time_splines)
    if not splines or not set(names).issuperset(itertools.chain(*coefficients)):
        raise ArgumentError(
            "refine is not allowed for an optimum without a TimeSpline, or with one of which not "
            "all coefficients are varied: give such laws, and bounds of each coefficient in vary."
        )
    if any(map(is_sum_of_parameters, best.problem.wanted.values())):
        raise ArgumentError("refine is not allowed with Linear sums of parameters: leave them out.")
    scene = eqx.tree_at(time_splines, best.scene, [*map(with_halved_intervals, splines)])
    for old, new in zip(coefficients, coefficient_names(scene, time_splines), strict=True):
        bounds = np.array([vary.pop(name) for name in old])
        vary |= dict.fromkeys(new, (bounds.min(), bounds.max()))
    return scene, variables_of(scene, vary)


def with_halved_intervals(spline: TimeSpline) -> TimeSpline:
    """The same function in twice as many intervals, by the rule of Lane and Riesenfeld (1980)."""
    old = spline.torque
    first, *middles = [0.5 * (one + other) for one, other in itertools.pairwise(old)]
    new = [first]
    for vertex, middle in zip(old[1:-1], middles, strict=True):
        new += [0.25 * (new[-1] + 2.0 * vertex + middle), middle]
    return eqx.tree_at(lambda law: law.torque, spline, tuple(new))
