"""Upright view of the walker: gravity down the page and the slope inclined."""

from typing import NamedTuple

import numpy as np

from jaxbiped.dynamics._feet import feet
from jaxbiped.dynamics._redundant_state import minimal_state
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import Scene


class Pose(NamedTuple):
    """Points of the walker, arrays of shape (n, 2): horizontal and vertical position [m].

    Attributes:
        hip: the hip.
        feet: centres of foot 1 and foot 2.
    """

    hip: np.ndarray
    feet: tuple[np.ndarray, np.ndarray]


def upright(scene: Scene, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Points of the slope's frame [m] with gravity pointing down the page, shape (..., 2)."""
    slope = float(scene.ground.slope)
    horizontal = np.cos(slope) * x + np.sin(slope) * z
    vertical = np.cos(slope) * z - np.sin(slope) * x
    return np.stack([horizontal, vertical], axis=-1)


def poses(scene: Scene, state: State) -> Pose:
    """The walker at states with leaves of shape (n,)."""
    foot_1, foot_2 = feet(scene, state)
    hip = minimal_state(scene, state)
    return Pose(
        hip=upright(scene, np.asarray(hip.hip_x), np.asarray(hip.hip_z)),
        feet=(
            upright(scene, np.asarray(foot_1.x), np.asarray(foot_1.z)),
            upright(scene, np.asarray(foot_2.x), np.asarray(foot_2.z)),
        ),
    )
