"""Self-test of an installation: answers by this machine's own programs against known truths."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped._types import Scalar, as_float
from jaxbiped.caching._cached_jit import cached_jit
from jaxbiped.dynamics._state import RigidState, State
from jaxbiped.scene._ground import Ground
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._ready_scenes import seed_scene
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene._walker import Walker
from jaxbiped.simulate._rigid_walk import rigid_walk
from jaxbiped.simulate._simulate import simulate

_FALL = 0.3
"""How long a walker falls freely [s]."""
_PUBLISHED = (0.200310900544287, -0.199832473004977)
"""Stance angle and rate of the simplest walker's long gait at a slope of 0.009, after Garcia,
Chatterjee, Ruina and Coleman, Journal of Biomechanical Engineering 120 (1998) 281."""


class Truth(NamedTuple):
    """One number that is known, and what this machine says.

    Attributes:
        name: what it is.
        known, found: the truth, and this machine's answer (SI units).
        allowed: by how much they may differ.
    """

    name: str
    known: float
    found: float
    allowed: float

    @property
    def holds(self) -> bool:
        return abs(self.found - self.known) <= self.allowed


def self_test() -> tuple[Truth, ...]:
    """Free fall and its derivative by lanes, and a published gait of rigid feet."""
    height, derivative = _fall()
    return (
        Truth("height after free fall [m]", 2.0 - 0.5 * 9.8 * _FALL**2, height, 1e-9),
        Truth("its derivative with respect to g [s²]", -0.5 * _FALL**2, derivative, 1e-9),
        Truth("simplest walker's angle after a footstep [rad]", _PUBLISHED[0], _footstep(), 1e-7),
    )


def _fall() -> tuple[float, float]:
    """Of a walker that is let go 2 m above level ground: height of its hip, and by gravity."""
    scene = with_parameters(seed_scene(), {"slope": 0.0})
    start = State(*map(as_float, (0.0, 2.0, 0.1, -0.1, 0.0, 0.0, 0.0, 0.0)))
    found, slope = _height_and_slope(scene, start, as_float(9.8))
    return float(found), float(slope)


@cached_jit
def _height_and_slope(scene: Scene, start: State, g: Scalar) -> tuple[Scalar, Scalar]:
    def height(g: jax.Array) -> jax.Array:
        moved = with_parameters(scene, {"g": g})
        end = simulate(moved, start, duration=_FALL, save="end", engine="lanes")
        return end.final.hip_z

    found: tuple[Scalar, Scalar] = jax.jvp(height, (g,), (jnp.ones_like(g),))
    return found


def _footstep() -> float:
    """Angle of the next stance leg, in its own direction."""
    theta, rate = _PUBLISHED
    # Legs without mass: their own, at the feet, is far below rounding.
    walker = Walker(m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0)
    scene = RigidScene(walker=walker, ground=Ground(slope=0.009, g=1.0))
    swing = rate - rate * (1.0 - np.cos(2.0 * theta))
    start = RigidState(*map(as_float, (0.0, -theta, theta, swing, rate)))
    end = rigid_walk(scene, start, footsteps=1)
    return max(float(end.final.theta_1), float(end.final.theta_2))
