"""Gaits of designs: of one, or of many as one batch by lanes, with their functionals."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import state_type
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.optimise._objective_values import BothFunctionals, functionals_of
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RigidScene, Scene


class GaitSettings(NamedTuple):
    """How gaits are found; see `find_gait`."""

    footsteps: int = 1
    accuracy: str = "balanced"
    engine: str = "auto"

    def find(self, scene: Scene | RigidScene, start: PyTree | None) -> Gait:
        """The gait of a scene near a state; from nothing for None."""
        return find_gait(scene, start, radius_sensitivities=False, **self._asdict())

    def find_near(self, scene: Scene | RigidScene, point: np.ndarray) -> Gait:
        """The gait of a scene near recurring components of a state, shape (m,)."""
        start = state_type(scene)(0.0, *point.tolist())
        return self.find(scene, jtu.tree_map(np.float64, start))


def are_walks(gaits: Gait) -> np.ndarray:
    """Whether a gait was found, and is a walk: of one or of a batch."""
    return (np.asarray(gaits.ending) == int(Search.FOUND)) & np.asarray(gaits.sound)


def gaits_near(
    scene: Scene | RigidScene,
    values: Mapping[str, np.ndarray],
    points: np.ndarray,
    settings: GaitSettings,
    wanted: tuple[str, ...] = (),
) -> tuple[Scene | RigidScene, Gait, BothFunctionals]:
    """Gaits of n scenes that differ in some parameters.

    Args:
        scene: the walker.
        values: of those parameters by name, shape (n,).
        points: guesses of the recurring components, shape (n, m).
        settings: how they are found.
        wanted: measures whose functionals are told.

    Returns:
        The scenes, the gaits and their functionals, leaves (n, …).

    Raises:
        ArgumentError: parameters that do not go together.
    """
    count = len(points)
    scenes = with_parameters(scene, {name: jnp.asarray(each) for name, each in values.items()})
    scenes = jtu.tree_map(lambda leaf: jnp.broadcast_to(jnp.asarray(leaf), (count,)), scenes)
    starts = state_type(scene)(jnp.zeros(count), *map(jnp.asarray, points.T))
    return scenes, *jax.device_get(_find_each(scenes, starts, wanted, settings))


@cached_jit
def _find_each(
    scenes: Scene | RigidScene, starts: PyTree, wanted: tuple[str, ...], settings: GaitSettings
) -> tuple[Gait, BothFunctionals]:
    def one(scene: Scene | RigidScene, start: PyTree) -> tuple[Gait, BothFunctionals]:
        gait = settings.find(scene, start)
        return gait, functionals_of(scene, gait, wanted, settings.footsteps, settings.accuracy)

    return jax.vmap(one)(scenes, starts)
