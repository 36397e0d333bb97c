"""Coordinates in which starts differ: of the state, and the scene's parameters."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.dynamics._state import coordinate_quantity, recurring_names
from jaxbiped.scene._parameter_access import parameter_names, parameter_quantities, with_parameters
from jaxbiped.scene._scene import AbstractScene

START_QUANTITIES = {
    "theta_stance": Quantity("stance leg angle", r"$\theta_2$", "rad"),
    "theta_swing": Quantity("swing leg angle", r"$\theta_1$", "rad"),
    "omega_stance": Quantity("stance leg rate", r"$\omega_2$", "rad/s"),
    "omega_swing": Quantity("swing leg rate", r"$\omega_1$", "rad/s"),
}
"""What angles and rates of two legs "1" and "2" are, by what the leg does where a cycle begins."""


def state_coordinates(scene: AbstractScene) -> dict[str, str]:
    """The state's coordinates that starts can differ in, and the leaves that they stand for.

    Where the bodies "1" and "2" are legs, `theta_stance`, `theta_swing` and their rates are other
    names of theirs.
    """
    check_type("scene", scene, AbstractScene)
    names = recurring_names(scene.state_type)
    return {**scene.coordinate_aliases, **{name: name for name in names}}


def coordinate_names(scene: AbstractScene) -> tuple[str, ...]:
    """Names of all coordinates in which starts of a scene can differ.

    Args:
        scene: the walker, compliant or rigid, or a hybrid system.

    Returns:
        Names of the state's coordinates except cyclic ones such as `ROOT_x`, and then of the
        scene's parameters. For two legs "1" and "2", the aliases `theta_stance`, `theta_swing` and
        those of their rates come first.

    Examples:
        >>> import jaxbiped as jb
        >>> jb.starts.coordinate_names(jb.seed_scene())[:2]
        ('theta_stance', 'theta_swing')
    """
    return (*state_coordinates(scene), *parameter_names(scene))


def coordinate_quantities(scene: AbstractScene) -> dict[str, Quantity]:
    """Words, symbol and unit of each coordinate in which starts of a scene can differ, by name.

    Args:
        scene: the walker, compliant or rigid, or a hybrid system.

    Returns:
        A `Quantity` (words, symbol and SI unit) for each name.
    """
    kind, aliases = scene.state_type, scene.coordinate_aliases
    own = {
        name: START_QUANTITIES[name] if name in aliases else coordinate_quantity(kind, name)
        for name in state_coordinates(scene)
    }
    return own | parameter_quantities(scene)


def check_coordinates(scene: AbstractScene, names: Iterable[str]) -> None:
    """Raises `ArgumentError` for what is no coordinate of the scene's starts, or named twice."""
    leaves, told = state_coordinates(scene), dict[str, str]()
    for name in names:
        check_choice("coordinate", name, coordinate_names(scene))
        other = told.setdefault(leaves.get(name, name), name)
        if other != name:
            raise ArgumentError(
                f"{other} and {name} are not allowed together: they are one coordinate; give one."
            )


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
    scene: Any, given: Mapping[str, npt.ArrayLike], argument: str
) -> dict[str, np.ndarray]:
    """`axis_values` of parameters that the scene has and allows, of an `argument` of that name."""
    check_type(argument, given, Mapping)
    axes = {}
    for name, values in given.items():
        check_choice(argument, name, parameter_names(scene))
        axes[name] = axis_values(name, values)
        with_parameters(scene, {name: axes[name]})
    return axes


def parameters_among(
    scene: AbstractScene, columns: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    own = state_coordinates(scene)
    return {name: column for name, column in columns.items() if name not in own}


def state_at(scene: AbstractScene, base: PyTree, columns: Mapping[str, np.ndarray]) -> PyTree:
    """The states (n,) with these coordinates, all else from the base's leaves (n,)."""
    leaves = state_coordinates(scene)
    return base._replace(**{leaves[name]: columns[name] for name in columns if name in leaves})
