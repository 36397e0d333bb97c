"""Default start of a command: the seed's start, fitted to the scene."""

import math
from typing import Any

import jax.numpy as jnp
import jax.tree_util as jtu
from jaxtyping import PyTree

import jaxbiped as jb
from jaxbiped._types import Scalar
from jaxbiped.caching._cached_jit import cached_jit

_DEEPEST = 0.1
"""The deepest that a foot begins in a soft ground, in units of l."""
_STEP = 1.01
"""Factor of the depth over which a law's exponent is read."""
_ROUNDS = 8


def default_start(scene: Any) -> Any:
    """The seed's start, fitted to the scene's legs and as loaded on its ground as on its own.

    For the seed's own scene it is the seed's start to the last bit.
    """
    seed, own = jb.seed_state(), jb.seed_scene()
    if scene.compliant and _fitted_to(scene.walker, scene.normal, scene.ground.g) == _fitted_to(
        own.walker, own.normal, own.ground.g
    ):
        return seed
    from jaxbiped.gait._search_starts import default_guess

    start: Any = default_guess(scene)
    if not scene.compliant:
        return start
    depth = jb.dynamics.standing_height(own, seed.theta_2) - seed.hip_z
    load = (scene.walker.total_mass * scene.ground.g) / (own.walker.total_mass * own.ground.g)
    fitted = float(_depth(scene.normal, own.normal, depth, load))
    if not math.isfinite(fitted):
        return start
    fitted = min(fitted, _DEEPEST * float(scene.walker.l))
    return start._replace(hip_z=jb.dynamics.standing_height(scene, seed.theta_2, fitted))


def _fitted_to(*parts: PyTree) -> tuple[jtu.PyTreeDef, list[float]]:
    """What a start is fitted to, to be compared."""
    leaves, structure = jtu.tree_flatten(parts)
    return structure, [float(leaf) for leaf in leaves]


@cached_jit
def _depth(
    law: jb.laws.AbstractNormalLaw, own: jb.laws.AbstractNormalLaw, depth: Scalar, load: Scalar
) -> Scalar:
    """Where a law's elastic force is `load` times another one's at `depth` [m].

    Elastic forces grow like powers of the depth, or nearly so.
    """
    target, found = load * own.elastic_force(depth), depth
    for _ in range(_ROUNDS):
        force = law.elastic_force(found)
        exponent = jnp.log(law.elastic_force(_STEP * found) / force) / jnp.log(_STEP)
        found = found * (target / force) ** (1.0 / exponent)
    return found
