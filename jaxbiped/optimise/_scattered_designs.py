"""Restarts: designs scattered over the bounds, their gaits sought as one batch by lanes."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import state_type
from jaxbiped.dynamics._state_quantities import recurring_leaves, state_of_recurring
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._design_problem import Design, DesignProblem
from jaxbiped.optimise._ensemble import GaitSettings
from jaxbiped.scene._parameter_access import parameter_names, with_parameters
from jaxbiped.scene._scene import RigidScene, Scene

_DRAWN = 8
"""Designs that are drawn for each one that is kept."""
_STAGES = 4
"""Steps in which the gaits of all of them are followed from the first design's."""


def scattered_designs(problem: DesignProblem, begin: Design, count: int, seed: int) -> list[Design]:
    """The best of many scattered designs, those that keep the requirements before all others."""
    from scipy.stats import qmc

    u = qmc.Sobol(len(begin.u), seed=seed).random(_DRAWN * count)
    points = follow_designs(problem, begin, u)
    found: list[Design] = []
    for each, point in zip(u, points, strict=True):
        if not np.all(np.isfinite(point)):
            continue
        known = problem.evaluations.get(each) or problem.from_guess(each, point)
        if known is not None:
            found.append(Design(each, known))
    found.sort(key=lambda d: (max(problem.excess(d.known), 0.0), problem.objective(d.known)[0]))
    return found[:count]


def follow_designs(problem: DesignProblem, begin: Design, u: np.ndarray) -> np.ndarray:
    """States of the gaits of designs (n, k) on the section, shape (n, m); NaN where lost."""
    points = np.broadcast_to(begin.known.state, (len(u), len(begin.known.state))).copy()
    slopes = np.broadcast_to(begin.known.state_slopes, (len(u), *begin.known.state_slopes.shape))
    before = np.broadcast_to(begin.u, u.shape)
    for share in np.linspace(0.0, 1.0, _STAGES + 1)[1:]:
        here = begin.u + share * (u - begin.u)
        moves = np.stack(
            [
                problem.variables.values(b) - problem.variables.values(a)
                for a, b in zip(before, here, strict=True)
            ]
        )
        places = problem.variables.places
        points = points + np.einsum("nmk,nk->nm", slopes[:, :, places], moves)
        points, slopes = _gaits_near(problem, here, points)
        before = here
    return points


def _gaits_near(
    problem: DesignProblem, u: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gaits of designs near guesses, and their derivatives (n, m, p); NaN where there are none."""
    count, names = len(u), parameter_names(problem.scene)
    columns = np.stack([problem.variables.values(each) for each in u])
    allowed = np.asarray([_is_allowed(problem, each) for each in u])
    own = np.where(allowed[:, None], columns, columns[np.argmax(allowed)])
    scenes = with_parameters(
        problem.scene,
        {name: jnp.asarray(own[:, i]) for i, name in enumerate(problem.variables.names)},
    )
    scenes = jtu.tree_map(lambda leaf: jnp.broadcast_to(jnp.asarray(leaf), (count,)), scenes)
    kind = state_type(problem.scene)
    safe = np.where(np.isfinite(points), points, 0.0)
    starts = state_of_recurring(kind, map(jnp.asarray, safe.T), jnp.zeros(count))
    gaits = _find_each(scenes, starts, problem.settings)
    good = np.asarray((gaits.ending == int(Search.FOUND)) & gaits.sound) & allowed
    good &= np.all(np.isfinite(points), axis=1)
    found = np.stack(recurring_leaves(gaits.measures.state), axis=1)
    slopes = np.stack(recurring_leaves(gaits.sensitivities.state), axis=1)
    assert slopes.shape == (count, points.shape[1], len(names))
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


@cached_jit
def _find_each(scenes: Scene | RigidScene, starts: PyTree, settings: GaitSettings) -> Gait:
    def one(scene: Scene | RigidScene, start: PyTree) -> Gait:
        return find_gait(
            scene,
            start,
            radius_sensitivities=False,
            footsteps=settings.footsteps,
            accuracy=settings.accuracy,
            engine=settings.engine,
        )

    return jax.vmap(one)(scenes, starts)
