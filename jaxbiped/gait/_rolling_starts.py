"""Scattered starts about the seed's, the stance foot rolling."""

from typing import cast

import jax
import jax.numpy as jnp

from jaxbiped._checks import check_positive
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._feet import standing_height
from jaxbiped.dynamics._state import RigidState, State, WalkerState, state_for, whole_state
from jaxbiped.gait._default_guess import default_guess
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene


def rolling_starts(
    scene: Scene | RigidScene, count: int, *, spread: float = 0.3, seed: int = 0
) -> WalkerState:
    """Starts about the seed's: its angles and leg rates scattered, the stance foot rolling.

    Args:
        scene: the walker, compliant or rigid.
        count: n, how many; the first is the seed's own, fitted to the scene.
        spread: largest relative change of an angle or rate.
        seed: of the random numbers.

    Returns:
        A `State` or `RigidState` with leaves of shape (n,): leg 2 stands as deep as in the seed's
        start, and does not slip.

    Raises:
        ArgumentError: count below 1, or spread not above 0.
    """
    scene = check_scene(scene, Scene, RigidScene)
    check_positive("count", count)
    check_positive("spread", spread)
    return _scatter(scene, int(count), float(spread), int(seed))


@cached_jit  # many small operations
def _scatter(scene: Scene | RigidScene, count: int, spread: float, seed: int) -> WalkerState:
    middle = default_guess(scene)
    scatter = jax.random.uniform(jax.random.key(seed), (4, count), minval=-1.0, maxval=1.0)
    factors = 1.0 + spread * scatter.at[:, 0].set(0.0)
    theta_1, theta_2 = middle.theta_1 * factors[0], middle.theta_2 * factors[1]
    omega_1, omega_2 = middle.omega_1 * factors[2], middle.omega_2 * factors[3]
    rolling = RigidState(jnp.zeros_like(theta_1), theta_1, theta_2, omega_1, omega_2)
    if isinstance(scene, RigidScene):
        return rolling
    depth = standing_height(scene, middle.theta_2) - cast("State", middle).hip_z
    height = standing_height(scene, theta_2, depth)
    return state_for(scene, whole_state(scene, rolling)._replace(hip_z=height))
