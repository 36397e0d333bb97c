"""Coordinates in which starts differ: of the state, and the scene's parameters."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxbiped._checks import check_choice
from jaxbiped.dynamics._rigid_state import RigidState
from jaxbiped.scene._parameters import parameter_names
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene

COORDINATES = {
    "theta_stance": "theta_2",
    "theta_swing": "theta_1",
    "omega_stance": "omega_2",
    "omega_swing": "omega_1",
    "hip_z": "hip_z",
    "hip_vx": "hip_vx",
    "hip_vz": "hip_vz",
}
"""Names of the state's coordinates, leg 2 standing, and the leaves that they stand for."""
UNITS = {
    "theta_stance": "rad",
    "theta_swing": "rad",
    "omega_stance": "rad/s",
    "omega_swing": "rad/s",
    "hip_z": "m",
    "hip_vx": "m/s",
    "hip_vz": "m/s",
    "slope": "rad",
    "K": "N/m^n",
    "c": "N s/m^2",
    "xi": "s/m",
    "v0": "m/s",
    "m": "kg",
    "J": "kg m^2",
    "l": "m",
    "d": "m",
    "r": "m",
    "g": "m/s^2",
    "hip_mass": "kg",
}


def coordinate_names(scene: Scene | RigidScene) -> tuple[str, ...]:
    """All coordinates that starts of a scene can differ in.

    Args:
        scene: the walker, compliant or rigid.

    Returns:
        Names of the state's coordinates, leg 2 standing, and then of the scene's parameters.

    Examples:
        >>> import jaxbiped as jb

        >>> jb.starts.coordinate_names(jb.seed_scene())[:2]
        ('theta_stance', 'theta_swing')
    """
    leaves = RigidState._fields if isinstance(scene, RigidScene) else None
    own = [name for name, leaf in COORDINATES.items() if leaves is None or leaf in leaves]
    return (*own, *parameter_names(scene))


def check_coordinates(scene: Scene | RigidScene, names: Any) -> None:
    """Raises `ArgumentError` for a name that is no coordinate of the scene's starts."""
    for name in names:
        check_choice("coordinate", name, coordinate_names(scene))


def parameters_among(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Those of the coordinates that are parameters of the scene."""
    return {name: column for name, column in columns.items() if name not in COORDINATES}


def state_at(base: Any, columns: Mapping[str, np.ndarray]) -> Any:
    """The states (n,) with these coordinates, all else from the base's leaves (n,)."""
    changed = {COORDINATES[name]: column for name, column in columns.items() if name in COORDINATES}
    return base._replace(**changed)


def place_states(scene: Any, base: Any, states: Any, named: Any) -> Any:
    """States whose stance foot is as deep, and rolls and slips, as the base's does.

    The hip's height and velocity follow from the stance leg where they are not `named`. A rigid
    walker's do anyway.
    """
    if isinstance(states, RigidState):
        return states
    length, radius = scene.walker.hip_to_foot, scene.walker.r

    def rolling(state: Any) -> dict[str, np.ndarray]:
        sine, cosine = np.sin(state.theta_2), np.cos(state.theta_2)
        return {
            "hip_z": length * cosine,
            "hip_vx": -(length * cosine + radius) * state.omega_2,
            "hip_vz": -length * sine * state.omega_2,
        }

    old, new = rolling(base), rolling(states)
    moved = {leaf: getattr(base, leaf) + new[leaf] - old[leaf] for leaf in new if leaf not in named}
    return states._replace(**moved)
