"""Restarts: designs scattered over the bounds, their gaits sought as one batch by lanes."""

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped.dynamics._state_quantities import recurring_leaves
from jaxbiped.optimise._design_gaits import are_walks, gaits_near
from jaxbiped.optimise._design_problem import Design, DesignProblem

_DRAWN = 8
"""Designs that are drawn for each one that is kept."""
_STAGES = 4
"""Steps in which the gaits of all of them are followed from the first design's."""


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
    found.sort(
        key=lambda design: (problem.excess(design.known), problem.objective(design.known)[0])
    )
    return found[:count]


def follow_designs(problem: DesignProblem, begin: Design, u: np.ndarray) -> np.ndarray:
    """States of the gaits of designs (n, k) on the section, shape (n, m); NaN where lost."""
    variables, known = problem.variables, begin.known
    points, slopes = (
        np.broadcast_to(each, (len(u), *each.shape)) for each in (known.state, known.state_slopes)
    )
    before = np.broadcast_to(begin.u, u.shape)
    for share in np.linspace(0.0, 1.0, _STAGES + 1)[1:]:
        here = begin.u + share * (u - begin.u)
        moves = variables.values(here) - variables.values(before)
        points = points + np.einsum("nmk,nk->nm", slopes[:, :, variables.places], moves)
        points, slopes = _gaits_of_designs(problem, here, points)
        before = here
    return points


def _gaits_of_designs(
    problem: DesignProblem, u: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gaits of designs near guesses, and their derivatives (n, m, p); NaN where there are none."""
    columns, allowed = problem.variables.values(u), np.asarray([_is_allowed(problem, x) for x in u])
    own = np.where(allowed[:, None], columns, columns[np.argmax(allowed)])
    known = np.isfinite(points)
    values = dict(zip(problem.variables.names, own.T, strict=True))
    starts = np.where(known, points, 0.0)
    _, gaits, _ = gaits_near(problem.scene, values, starts, problem.settings)
    good = are_walks(gaits) & allowed & np.all(known, axis=1)
    found, slopes = (
        np.stack(recurring_leaves(states), axis=1)
        for states in (gaits.measures.state, gaits.sensitivities.state)
    )
    return (
        np.where(good[:, None], found, np.nan),
        np.where(good[:, None, None], slopes, np.nan),
    )


def _is_allowed(problem: DesignProblem, u: np.ndarray) -> bool:
    try:
        problem.scene_at(u)
    except ArgumentError:
        return False
    return True
