"""Periodic gaits from many starts."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._jax_versions import without_switches
from jaxbiped._types import Scalar, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import recurring_leaves
from jaxbiped.gait._find_gait import find_gait
from jaxbiped.gait._fixed_point_search import Search
from jaxbiped.gait._gait import Gait
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._state_types import RigidState, State, WalkerState

_SAME = 1e-4
"""Largest difference of a component (SI units) between two finds of one gait."""


class Gaits(NamedTuple):
    """The distinct gaits that n starts led to, the one reached most often first.

    Attributes:
        gaits: k gaits, every array with a first axis of k.
        reached: from how many starts each was, shape (k,).
        which: the gait that each start led to, −1 where none, shape (n,).
        ending: code of a `Search` of each start, shape (n,): "no walk" where it led to an orbit
            that is none.
    """

    gaits: Gait
    reached: Scalar
    which: Scalar
    ending: Scalar


@without_switches
def find_gaits(scene: Scene | RigidScene, starts: State | RigidState, **options: Any) -> Gaits:
    """Searches for periodic gaits from many starts at once, and distinguishes those that it finds.

    The gaits have no derivatives with respect to parameters. To obtain these, pass the state of a
    gait to `find_gait` as its guess.

    Args:
        scene: the walker.
        starts: n starts, a state with leaves of shape (n,); see `rolling_starts`.
        options: those of `find_gait`, except parameters and radius_sensitivities.

    Returns:
        The distinct gaits, and which of them each of the n searches found.

    Raises:
        ArgumentError: an argument is not allowed; raised before anything is compiled.
    """
    scene = check_scene(scene, Scene, RigidScene)
    shapes = {jnp.shape(leaf) for leaf in jtu.tree_leaves(starts)}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1 or next(iter(shapes)) == (0,):
        raise ArgumentError(
            f"starts has leaves of shapes {sorted(shapes)}: they must all be (n,), n at least 1."
        )

    found = _find_each(scene, jtu.tree_map(as_float, starts), options)
    gaits = jtu.tree_map(np.asarray, found)
    first, which = _told_apart(gaits)
    reached = np.bincount(which[which >= 0], minlength=len(first))
    order = np.argsort(-reached, kind="stable")
    place = np.argsort(order)
    chosen = np.asarray(first, dtype=int)[order]
    return Gaits(
        gaits=jtu.tree_map(lambda leaf: jnp.asarray(leaf[chosen]), gaits),
        reached=jnp.asarray(reached[order]),
        which=jnp.asarray([place[k] if k >= 0 else -1 for k in which], dtype=int),
        ending=found.ending,
    )


@cached_jit
def _find_each(scene: Scene | RigidScene, starts: WalkerState, options: dict[str, Any]) -> Gait:
    def one(start: WalkerState) -> Gait:
        return find_gait(scene, start, parameters=(), radius_sensitivities=False, **options)

    return jax.vmap(one)(starts)


def _told_apart(gaits: Gait) -> tuple[list[int], np.ndarray]:
    """The first start that found each gait, and which of these gaits each start found.

    A gait is the same wherever its orbit was entered: its state is one of the other's crossings.
    """
    states = np.stack(recurring_leaves(gaits.measures.state), axis=1)
    crossings = np.stack([leaf[:, :, 0] for leaf in recurring_leaves(gaits.orbit[1])], axis=2)
    first: list[int] = []
    which = np.full(len(states), -1)
    for i in np.flatnonzero(np.asarray(gaits.ending) == int(Search.FOUND)):
        near = [
            k
            for k, j in enumerate(first)
            if np.min(np.max(np.abs(states[i] - crossings[j]), axis=1)) <= _SAME
        ]
        if not near:
            first.append(int(i))
        which[i] = near[0] if near else len(first) - 1
    return first, which
