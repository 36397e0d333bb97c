"""Nearest failure: the nearest start that does not return to the gait."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxbiped._checks import ArgumentError, check_type
from jaxbiped._types import as_float, in_parts
from jaxbiped.basins._labels import Label
from jaxbiped.basins._minimal_fatal_shock import FatalShock, minimal_fatal_shock
from jaxbiped.basins._rays import Normal
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import recurring_leaves, state_of_recurring
from jaxbiped.gait._return_map import return_map
from jaxbiped.hybrid._admissible_directions import admissible_directions
from jaxbiped.hybrid._sections import AbstractSection
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.sweep._attractor import Attractor
from jaxbiped.sweep._gait_family import scene_with
from jaxbiped.sweep._labelling import Labelling

_MOST_FOOTSTEPS = 6
"""After which the distance from the gait is differentiated."""
_AT_ONCE = 8
"""Points whose derivatives are taken at once, always as many: every other number compiles anew."""


def nearest_failure(
    labelling: Labelling,
    *,
    gradients: bool = True,
    max_distance: float = 1.0,
    tolerance: float = 1e-5,
    **options: Any,
) -> FatalShock:
    """The smallest push away from the first gait, on its section, after which the walk fails.

    On rigid feet, a push leaves held stops held, and moves no angle beyond a stop. A push of a
    hybrid system leaves its modes, and moves no state beyond a guard that resets it.

    The coordinates are all m leaves of the state except cyclic ones (`ROOT_x`), in their order.
    Distances are measured in the scales `Family.scales`: 1 rad for angles, √(g l) for velocities,
    √(g/l) for rates, and the stance foot's penetration for the height of the root point; those of a
    hybrid system are its state's `scales`. Every label except walking, or of a hybrid system
    periodic, is a failure.

    Args:
        labelling: a labelling that has a gait.
        gradients: whether rays are rotated to the boundary's normal with the simulator's
            derivatives, instead of differences of the distances along nearby rays.
        max_distance: maximum distance of the search.
        tolerance: tolerance of the distance.
        options: other options of `minimal_fatal_shock`.

    Returns:
        The push to the nearest failing start, and its distance in the scales above.

    Raises:
        ArgumentError: the labelling has no gait, or an argument of `minimal_fatal_shock` is not
            allowed.
    """
    check_type("labelling", labelling, Labelling)
    family = labelling.family
    if not family.rows[0]:
        raise ArgumentError("labelling has no stable gait, so there is no gait to push.")
    attractor = family.rows[0][0]
    scene = scene_with(labelling.scene, family.names, family.table[0])
    scales = np.asarray(family.scales[0])
    ways = admissible_directions(scene, attractor.state, scales)

    def point_of(pushes: np.ndarray) -> np.ndarray:
        return attractor.point + scales * (pushes @ ways.T)

    def fails(pushes: np.ndarray) -> np.ndarray:
        count = len(pushes)
        states = state_of_recurring(type(attractor.state), point_of(pushes).T, np.zeros(count))
        parameters = {
            name: np.full(count, value)
            for name, value in zip(family.names, family.table[0], strict=True)
        }
        found = labelling(states, parameters=parameters)
        failed = found.label != int(Label.WALKING)
        return (failed & ~system_of(scene).lies_beyond(scene, states)).astype(int)

    section = labelling.effort.section
    normal = boundary_normal(scene, attractor, section) if gradients else None
    shock = minimal_fatal_shock(
        fails,
        np.zeros(ways.shape[1]),
        scales=np.ones(ways.shape[1]),
        max_distance=max_distance,
        tolerance=tolerance,
        normal=None if normal is None else lambda u: (normal(point_of(u)) * scales) @ ways,
        **options,
    )
    return shock._replace(
        push=scales * (ways @ shock.push),
        boundary_point=point_of(shock.boundary_point),
        direction=ways @ shock.direction,
    )


def boundary_normal(
    scene: AbstractScene,
    attractor: Attractor,
    section: AbstractSection | None = None,
) -> Normal:
    """Gradients of the distance from the gait after a few footsteps, at points (n, m).

    Starts on the boundary of the basin follow it towards an unstable gait, all to one place: so
    that distance is constant along the boundary, but for what has not died out by then. As many
    footsteps are taken as the start has left before it fails, up to a few.
    """
    scene = jax.tree.map(as_float, scene)

    def arrivals(points: np.ndarray) -> PyTree:
        return _arrivals(scene, type(attractor.state), section, jnp.asarray(points))

    return _normal_by(arrivals, attractor)


def _normal_by(arrivals: Callable[[np.ndarray], PyTree], attractor: Attractor) -> Normal:
    squared = attractor.metric.T @ attractor.metric

    def some(points: np.ndarray) -> np.ndarray:
        at, on = np.array(points), np.ones(len(points), dtype=bool)
        slopes = np.broadcast_to(np.eye(at.shape[1]), (*at.shape, at.shape[1])).copy()
        walked = np.zeros(len(points), dtype=int)
        for _ in range(_MOST_FOOTSTEPS):
            change, (after, code) = jax.tree.map(np.asarray, arrivals(at))
            on = on & (code == 0) & np.isfinite(change).all(axis=(1, 2))
            slopes[on] = change[on] @ slopes[on]
            at[on] = after[on]
            walked += on
        gradients = np.einsum("ni,nij->nj", attractor.offsets_of(at) @ squared, slopes)
        return np.where(walked[:, None] > 0, gradients, np.nan)

    def normal(points: np.ndarray) -> np.ndarray:
        return in_parts(some, points, _AT_ONCE) if len(points) else np.array(points)

    return normal


@cached_jit
def _arrivals(
    scene: AbstractScene,
    kind: type,
    section: AbstractSection | None,
    points: Array,
) -> PyTree:
    """Derivatives of the next arrivals from points (n, m), these arrivals and their codes."""

    def arrival(point: Array) -> tuple[Array, tuple[Array, Array]]:
        came = return_map(scene, state_of_recurring(kind, point, jnp.zeros(())), section=section)
        after = jnp.stack(recurring_leaves(came.state))
        return after, (after, came.code)

    return jax.vmap(jax.jacfwd(arrival, has_aux=True))(points)
