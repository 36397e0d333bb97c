"""Coordinates in which starts differ: of the state, and the scene's parameters."""

from collections.abc import Collection, Iterable, Mapping

import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped._quantity import Quantity
from jaxbiped.dynamics._state import BristleState, RigidState, State, state_type
from jaxbiped.dynamics._state_quantities import STATE_QUANTITIES
from jaxbiped.scene._parameter_access import parameter_names, parameter_quantities, with_parameters
from jaxbiped.scene._scene import AbstractWalkerScene, RigidScene, Scene

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
_QUANTITIES = {
    "theta_swing": Quantity("swing leg angle", r"$\theta_1$", "rad"),
    "theta_stance": Quantity("stance leg angle", r"$\theta_2$", "rad"),
    "omega_swing": Quantity("swing leg rate", r"$\omega_1$", "rad/s"),
    "omega_stance": Quantity("stance leg rate", r"$\omega_2$", "rad/s"),
}
START_QUANTITIES = {name: _QUANTITIES.get(name) or STATE_QUANTITIES[name] for name in COORDINATES}
"""What the state's coordinates are."""


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
    leaves = state_type(scene)._fields
    own = [name for name, leaf in COORDINATES.items() if leaf in leaves]
    return (*own, *parameter_names(scene))


def coordinate_quantities(scene: Scene | RigidScene) -> dict[str, Quantity]:
    """What each coordinate that starts of a scene can differ in is, with its unit, by name.

    Args:
        scene: the walker, compliant or rigid.

    Returns:
        A `Quantity` (words, symbol and SI unit) by each name.
    """
    known = START_QUANTITIES | parameter_quantities(scene)
    return {name: known[name] for name in coordinate_names(scene)}


def check_coordinates(scene: Scene | RigidScene, names: Iterable[str]) -> None:
    """Raises `ArgumentError` for a name that is no coordinate of the scene's starts."""
    for name in names:
        check_choice("coordinate", name, coordinate_names(scene))


def axis_values(name: str, values: npt.ArrayLike) -> np.ndarray:
    """Values along an axis of a grid, shape (k,).

    Raises:
        ArgumentError: none at all, one that is not finite, or values of another shape.
    """
    check_finite(name, values)
    if np.ndim(values) != 1 or not np.size(values):
        raise ArgumentError(
            f"{name} has values of shape {np.shape(values)}: it must be (k,), k at least 1."
        )
    return np.asarray(values, dtype=np.float64)


def parameter_axes(
    scene: AbstractWalkerScene, given: Mapping[str, npt.ArrayLike], argument: str
) -> dict[str, np.ndarray]:
    """`axis_values` of parameters that the scene has and allows, of an `argument` of that name."""
    axes = {}
    for name, values in given.items():
        check_choice(argument, name, parameter_names(scene))
        axes[name] = axis_values(name, values)
        with_parameters(scene, {name: axes[name]})
    return axes


def parameters_among(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Those of the coordinates that are parameters of the scene."""
    return {name: column for name, column in columns.items() if name not in COORDINATES}


def state_at(base: PyTree, columns: Mapping[str, np.ndarray]) -> PyTree:
    """The states (n,) with these coordinates, all else from the base's leaves (n,)."""
    changed = {COORDINATES[name]: column for name, column in columns.items() if name in COORDINATES}
    return base._replace(**changed)


def place_states(
    scene: AbstractWalkerScene, base: PyTree, states: PyTree, named: Collection[str]
) -> PyTree:
    """States whose stance foot is as deep, and rolls and slips, as the base's does.

    The hip's height and velocity follow from the stance leg where they are not `named`. A rigid
    walker's do anyway.
    """
    if isinstance(states, RigidState):
        return states
    length, radius = np.asarray(scene.walker.hip_to_foot), np.asarray(scene.walker.r)

    def rolling(state: State | BristleState) -> dict[str, np.ndarray]:
        sine, cosine = np.sin(state.theta_2), np.cos(state.theta_2)
        return {
            "hip_z": length * cosine,
            "hip_vx": -(length * cosine + radius) * state.omega_2,
            "hip_vz": -length * sine * state.omega_2,
        }

    old, new = rolling(base), rolling(states)
    moved = {leaf: getattr(base, leaf) + new[leaf] - old[leaf] for leaf in new if leaf not in named}
    return states._replace(**moved)
