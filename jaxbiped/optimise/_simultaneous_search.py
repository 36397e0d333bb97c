"""Simultaneous search: which problems it can take, where it begins, and the gait it comes to."""

import operator
from collections.abc import Iterator
from typing import Any

import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._progress import Stage
from jaxbiped.gait._return_map_spec import arrivals_of
from jaxbiped.gait._search_starts import default_guess, rolling_starts
from jaxbiped.hybrid._motion_costs import Extreme, has_motion_costs
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.optimise._design_problem import Design, DesignProblem, start_of
from jaxbiped.optimise._objectives import ParameterFunction, with_parts
from jaxbiped.optimise._optimisers import RunEnding
from jaxbiped.optimise._sequential_programming import run_newton
from jaxbiped.optimise._simultaneous import FROM_CYCLE, OF_CYCLE, Simultaneous, cycle_spec_of
from jaxbiped.scene._parameter_access import parameter_quantities

_BETTER = 1e-9
"""Relative difference from which another cycle counts as better."""
_MORE = 5
"""Further searches from drawn poses and designs while none has come to a gait."""


def check_simultaneous(problem: DesignProblem) -> None:
    """Raises `ArgumentError` for a problem that has no simultaneous search."""
    if reason := reason_against(problem):
        raise ArgumentError(
            f'formulation = "together" is not allowed {reason}: choose "gait by gait".'
        )


def reason_against(problem: DesignProblem) -> str | None:
    """Why a problem has no simultaneous search, in words; None if it has."""
    scene, settings = problem.scene, problem.settings
    if not has_motion_costs(scene.minimal):
        return f"for a {type(scene).__name__}, which is no walker"
    if not system_of(scene.minimal).footsteps_end_on_section:
        return "for compliant feet, which press into the ground for a while"
    if cycle_spec_of(scene.minimal, settings.engine).resets:
        return "for a walker whose modes change between strikes"
    if arrivals_of(scene, settings.footsteps) != 1:
        return "for a cycle of several footsteps"
    if problem.ensemble is not None:
        return "with scatter"
    every = with_parts(problem.wanted)
    combined = [measure.combined for measure in every.values() if measure.combined]
    parts = {name for combination in combined for name in combination.of}
    for name, objective in every.items():
        bounded = [requirement for requirement in problem.requirements if requirement.name == name]
        for weight, cost in objective.costs:
            if not isinstance(cost, Extreme):
                continue
            sides = [low if cost.sign > 0.0 else high for _, low, high in bounded]
            is_path = weight == 1.0 and len(objective.costs) == 1 and set(sides) == {None}
            if not is_path or name in (*problem.weights, *parts):
                return (
                    f"for {name}, an extreme, except as the upper bound of a largest value or the "
                    "lower bound of a smallest one"
                )
        is_sum = objective.costs or isinstance(objective.measured, ParameterFunction)
        if not (is_sum or objective.combined or name in OF_CYCLE):
            return f"for {name}, which is no integral along the cycle"
    return None


def _beginnings(
    whole: Simultaneous, pose: Any, period: float | None, more: int, seed: int
) -> Iterator[tuple[int, np.ndarray]]:
    """Points from which searches begin: two in any case, number 0, then drawn designs and poses.

    They are the scene's own design, and that with the least torques, which is often near the
    cheaper of several optima.
    """
    from scipy.stats import qmc

    scene, variables = whole.problem.scene, whole.problem.variables
    u = start_of(scene, variables)
    if period is None:
        yield 0, whole.rough_cycle(u, pose)
    else:
        yield 0, whole.followed_cycle(u, pose, period)
    quantities = parameter_quantities(scene)
    is_torque = [quantities[name].unit.startswith("N m") for name in variables.names]
    slack = np.where(is_torque, variables.positions(np.zeros(len(u))), u)
    if np.any(slack != u):
        yield 0, whole.rough_cycle(slack, pose)
    poses = rolling_starts(scene.minimal, more + 1, seed=seed)
    designs = qmc.Sobol(len(u), seed=seed).random_base2(more.bit_length())
    for k in range(1, more + 1):
        yield k, whole.rough_cycle(designs[k], jtu.tree_map(operator.itemgetter(k), poses))


def begin_together(
    problem: DesignProblem,
    near: Any,
    period: float | None,
    segments: int,
    iterations: int,
    drawn: tuple[int, int],
    now: Stage,
) -> tuple[Design, RunEnding]:
    """The design that simultaneous searches come to, with its gait, and how the best one ended.

    Args:
        problem: what is designed.
        near, period: the state of a gait and its period [s], from which the first search begins; or
            a rough pose, None for the default one, and None.
        segments, iterations: of each search.
        drawn: how many further searches begin at drawn poses and designs, and the seed.
        now: counts iterates.

    Raises:
        ArgumentError: no search came to a gait.
    """
    whole, (count, seed) = Simultaneous(problem, segments), drawn
    pose = default_guess(problem.scene.minimal) if near is None else near

    def report(z: np.ndarray) -> None:
        here = whole.at(z)
        missed = f", conditions missed by {here.violation:.1e}" if here.violation > 0.0 else ""
        now.update(found=f"objective {problem.sense * here.objective:.6g}{missed}")

    def gait_of(z: np.ndarray, farthest: float) -> np.ndarray | None:
        """The u of a point with a gait near its cycle."""
        starts, _, there = whole.parts(z)
        sizes = farthest * (np.abs(starts[0]) + whole.sizes)
        return None if problem.from_guess(there, starts[0], sizes) is None else there

    best: tuple[float, np.ndarray, RunEnding] | None = None
    no_gaits: list[tuple[float, np.ndarray]] = []
    others: list[tuple[float, np.ndarray, RunEnding]] = []
    for k, point in _beginnings(whole, pose, period, count + _MORE, seed):
        if k > count and best is not None:
            break
        z, ended = run_newton(whole, point, iterations, report)
        here = whole.at(z)
        if not ended.converged:
            others.append((here.violation, z, ended))
        elif best is None or here.objective < best[0] - _BETTER * abs(best[0]):
            there = gait_of(z, FROM_CYCLE)
            if there is None:
                no_gaits.append((here.objective, z))
            else:
                best = here.objective, there, ended
    if best is not None:
        return problem.begin(best[1]), best[2]
    for _, z, ended in sorted(others, key=lambda other: other[0]):
        there = gait_of(z, np.inf)
        if there is not None:
            return problem.begin(there), ended
    what = "no cycle was found"
    if no_gaits:
        value, z = min(no_gaits, key=lambda cycle: cycle[0])
        what = f"of the best cycle, of {problem.sense * value:.6g}, {whole.why_no_gait(z)}"
    raise ArgumentError(
        f'formulation = "together" came to no gait: {what}; give another guess, further '
        'requirements, such as "landing_speed>0.05", or restarts.'
    )
