"""Starts of a search: the fitted guess, scattered ones, and where walks from these settle."""

from collections.abc import Callable
from typing import Any, cast

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import check_positive
from jaxbiped._types import Scalar, as_float, select
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.compiler import host_jit
from jaxbiped.dynamics._contacts import standing_height
from jaxbiped.dynamics._section import MidStance
from jaxbiped.dynamics._state import (
    BristleState,
    RigidState,
    State,
    WalkerState,
    exchange_legs,
    rigid_state,
    seed_state,
    state_for,
    state_type,
    whole_state,
)
from jaxbiped.dynamics._state_quantities import STATE_QUANTITIES, recurring_leaves, recurring_names
from jaxbiped.scene._ready_scenes import seed_scene
from jaxbiped.scene._scene import AbstractWalkerScene, RigidScene, Scene
from jaxbiped.scene._scene_checks import check_scene
from jaxbiped.scene._walker import Walker
from jaxbiped.simulate._simulate import rigid_walk, simulate
from jaxbiped.solve._trajectory import Trajectory

_FOOTSTEPS = 40
_ALIKE = 1e-2
"""Scaled distance of two states that count as one."""
_DEPTH = 4
"""Longest cycle [footsteps] that is looked for in a walk's last arrivals."""


def default_guess(scene: AbstractWalkerScene) -> WalkerState:
    """The seed's start, fitted to the scene's legs and gravity; bristles, where any, straight."""
    dtype = jnp.result_type(scene.walker.l, float)
    return _fitted(scene, *jax.tree.map(dtype.type, _seed()))


@host_jit()  # many small operations
def _fitted(scene: AbstractWalkerScene, seed: State, own: Scene) -> WalkerState:
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


def settle_walks(scene: Scene | RigidScene, starts: PyTree, *, most: int = 4) -> list[np.ndarray]:
    """Where walks from the starts are after many footsteps, the most settled first.

    Args:
        scene: the walker.
        starts: states, leaves of shape (n,).
        most: how many to give.

    Returns:
        States on the section without hip_x, each of shape (m,), apart from each other.
    """
    walked: Callable[..., tuple[Scalar, PyTree]] = _arrivals if scene.compliant else _rigid_arrivals
    counts, last = walked(scene, starts)
    points = np.stack(recurring_leaves(last), axis=-1)
    walking = np.flatnonzero(np.asarray(counts) >= _FOOTSTEPS)
    sizes = component_sizes(scene, last)
    latest = points[walking, -1] / sizes
    before = points[walking, -1 - _DEPTH : -1] / sizes
    moved = np.min(np.linalg.norm(latest[:, None] - before, axis=-1), axis=-1, initial=np.inf)
    chosen: list[int] = []
    for i in np.argsort(moved):
        if all(np.linalg.norm(latest[i] - latest[j]) > _ALIKE for j in chosen):
            chosen.append(int(i))
        if len(chosen) == most:
            break
    return [latest[i] * sizes for i in chosen]


def component_sizes(scene: AbstractWalkerScene, state: WalkerState) -> np.ndarray:
    """Size of each component of a state without hip_x, shape (m,), SI units.

    Angles 1, lengths l, velocities √(g l), rates √(g/l), and bristles the number of l.
    """
    length, gravity = float(scene.walker.l), float(scene.ground.g)
    speed, rate = np.sqrt(gravity * length), np.sqrt(gravity / length)
    sizes = {"m": length, "": length, "m/s": speed, "rad/s": rate, "rad": 1.0}
    return np.array([sizes[STATE_QUANTITIES[name].unit] for name in recurring_names(state)])


@cached_jit
def _arrivals(scene: Scene, starts: PyTree) -> tuple[Scalar, PyTree]:
    """Arrivals at mid-stance of each walk, and the states at the last ones, leg 2 standing."""

    def one(start: PyTree) -> tuple[Scalar, PyTree]:
        walk = simulate(
            scene,
            start,
            footsteps=_FOOTSTEPS + 1,
            accuracy="draft",
            save=MidStance(),
            max_arrivals=_FOOTSTEPS,
            engine="lanes",
        )
        total, last = _last_arrivals(walk)
        stands = jnp.abs(last.theta_1) < jnp.abs(last.theta_2)
        return total, select(stands, exchange_legs(last), last)

    return jax.vmap(one)(starts)


@cached_jit
def _rigid_arrivals(scene: RigidScene, starts: PyTree) -> tuple[Scalar, PyTree]:
    """Heel strikes of each walk, and the states just after the last ones."""

    def one(start: PyTree) -> tuple[Scalar, PyTree]:
        walk = rigid_walk(scene, start, footsteps=_FOOTSTEPS, max_arrivals=_FOOTSTEPS)
        return _last_arrivals(walk)

    return jax.vmap(one)(starts)


def _last_arrivals(walk: Trajectory[Any]) -> tuple[Scalar, PyTree]:
    """How many arrivals a walk has, and the last states that there is room for."""
    assert walk.arrivals is not None
    return walk.arrivals.total, jtu.tree_map(lambda leaf: leaf[-1 - _DEPTH :], walk.arrivals.state)
