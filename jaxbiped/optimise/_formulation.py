"""Formulation of an optimisation: a gait for each design, or all unknowns together."""

from typing import Any

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._progress import Stage
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._design_problem import Design, DesignProblem, start_of
from jaxbiped.optimise._optimisers import OPTIMISERS, RunEnding
from jaxbiped.optimise._simultaneous_search import begin_together, reason_against

FORMULATIONS = ("auto", "gait by gait", "together")
_VIOLENT = 3.0
"""Multiplier from which gaits are lost between designs that are a step apart."""
_STEP = 0.1
"""Change of u that counts as a step."""
_FLOOR = 0.1
"""Size below which components of the state count as of one size."""


def first_design(
    problem: DesignProblem,
    formulation: str,
    optimiser: Any,
    guess: Any,
    near: Any,
    segments: int,
    iterations: int,
    drawn: tuple[int, int],
    now: Stage,
) -> tuple[Design, RunEnding | None, str]:
    """The design from which runs begin, how a search ended there, and the formulation in use.

    Args:
        problem: what is designed.
        formulation: one of `FORMULATIONS`.
        optimiser: of the runs; "auto" leaves the choice of another than the default as it is.
        guess, near: what the caller gave to begin from, and its state; or None.
        segments, iterations, drawn, now: see `begin_together`.

    Raises:
        ArgumentError: no gait was found to begin from.
    """
    u, known, lost = start_of(problem.scene, problem.variables), None, None
    period = float(guess.measures.period) if isinstance(guess, Gait) else None
    is_open = optimiser == OPTIMISERS[0] and reason_against(problem) is None
    if formulation == "gait by gait" or (formulation == "auto" and not is_open):
        return problem.begin(u, near), None, FORMULATIONS[1]
    if formulation == "auto" and not problem.scene.minimal.clock:
        try:
            known = problem.begin(u, near)
        except ArgumentError as error:
            lost = error
        else:
            gait = problem.first_gait
            if gait is None:
                gait = problem.settings.find_near(problem.scene_at(u), known.known.state)
            if not is_hard_to_follow(problem, known, gait):
                return known, None, FORMULATIONS[1]
            near, period = gait.measures.state, float(gait.measures.period)
    try:
        design, ended = begin_together(problem, near, period, segments, iterations, drawn, now)
    except ArgumentError as error:
        if known is not None:
            return known, None, FORMULATIONS[1]
        raise (error if lost is None else lost) from None
    return design, ended, FORMULATIONS[2]


def is_hard_to_follow(problem: DesignProblem, design: Design, gait: Gait) -> bool:
    """Whether a gait has a violent multiplier, or a fold lies within a step of its design.

    Where a real multiplier is λ, a gait meets a fold after a move of the order of (1 − λ)/2, in
    units of its state.
    """
    multipliers = np.asarray(gait.multipliers)
    if np.max(np.abs(multipliers), initial=0.0) > _VIOLENT:
        return True
    real = multipliers[np.abs(multipliers.imag) < 1e-9].real
    slopes = problem.gradient(design.u, design.known.state_slopes)
    moves = _STEP * np.abs(slopes) / (_FLOOR + np.abs(design.known.state))[:, None]
    nearest = np.min(np.abs(1.0 - real), initial=np.inf)
    return bool(np.max(moves, initial=0.0) > 0.5 * nearest)
