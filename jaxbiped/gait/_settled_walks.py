"""Settled walks: where walking forwards from many starts ends that does not fall."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar, select
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._section import MidStance
from jaxbiped.dynamics._state import WalkerState, exchange_legs
from jaxbiped.scene._scene import AbstractScene, RigidScene, Scene
from jaxbiped.simulate._rigid_walk import rigid_walk
from jaxbiped.simulate._simulate import simulate
from jaxbiped.solve._trajectory import Trajectory

_FOOTSTEPS = 40
_ALIKE = 1e-2
"""Scaled distance of two states that count as one."""
_DEPTH = 4
"""Longest cycle [footsteps] that is looked for in a walk's last arrivals."""


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
    points = np.stack([np.asarray(leaf) for leaf in last[1:]], axis=-1)
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


def component_sizes(scene: AbstractScene, state: WalkerState) -> np.ndarray:
    """Size of each component of a state without hip_x, shape (m,), SI units.

    Angles 1, lengths l, velocities √(g l), rates √(g/l).
    """
    length, gravity = float(scene.walker.l), float(scene.ground.g)
    by_prefix = {
        "theta": 1.0,
        "omega": np.sqrt(gravity / length),
        "hip_v": np.sqrt(gravity * length),
    }
    return np.array([by_prefix.get(name[:5], length) for name in state._fields[1:]])


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
