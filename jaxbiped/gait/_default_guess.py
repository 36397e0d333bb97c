"""Default initial guess of a search."""

import jax
import jax.numpy as jnp

from jaxbiped._types import Scalar, as_float
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._feet import standing_height
from jaxbiped.dynamics._state import (
    BristleState,
    State,
    WalkerState,
    rigid_state,
    seed_state,
    state_type,
)
from jaxbiped.scene._ready_scenes import seed_scene
from jaxbiped.scene._scene import AbstractScene, Scene
from jaxbiped.scene._walker import Walker


def default_guess(scene: AbstractScene) -> WalkerState:
    """The seed's start, fitted to the scene's legs and gravity; bristles, where any, straight."""
    dtype = jnp.result_type(scene.walker.l, float)
    return _fitted(scene, *jax.tree.map(dtype.type, _seed()))


@host_jit()  # many small operations
def _fitted(scene: AbstractScene, seed: State, own: Scene) -> WalkerState:
    """`own` is the seed's scene. As constants XLA would divide by its numbers by reciprocals."""
    if not scene.compliant:
        pace = jnp.sqrt(scene.ground.g / scene.walker.l * own.walker.l / own.ground.g)
        rates = dict(omega_1=seed.omega_1 * pace, omega_2=seed.omega_2 * pace)
        return jax.tree.map(as_float, rigid_state(seed)._replace(**rates))
    size = scene.walker.l / own.walker.l
    pace = jnp.sqrt(scene.ground.g / own.ground.g / size)
    depth = (standing_height(own, seed.theta_2) - seed.hip_z) * size

    def reach(walker: Walker) -> tuple[Scalar, Scalar]:
        return walker.hip_to_foot * jnp.cos(seed.theta_2) + walker.r, walker.hip_to_foot

    (forward, up), (own_forward, own_up) = reach(scene.walker), reach(own.walker)
    fitted = seed._replace(
        hip_z=standing_height(scene, seed.theta_2, depth),
        hip_vx=seed.hip_vx * forward / own_forward * pace,
        hip_vz=seed.hip_vz * up / own_up * pace,
        omega_1=seed.omega_1 * pace,
        omega_2=seed.omega_2 * pace,
    )
    start: State = jax.tree.map(as_float, fitted)
    if state_type(scene) is BristleState:
        straight = jnp.zeros_like(start.hip_x)
        return BristleState(**start._asdict(), bristle_1=straight, bristle_2=straight)
    return start


@bounded_cache(1)
def _seed() -> tuple[State, Scene]:
    """The seed's start and its scene, of plain numbers, which take no time to make."""
    with jax.ensure_compile_time_eval():
        return jax.tree.map(float, (seed_state(), seed_scene()))
