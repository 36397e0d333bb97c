"""Coordinates in which starts differ: of the state, and the scene's parameters."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_type
from jaxbiped._quantity import Quantity
from jaxbiped.dynamics._state import recurring_names, state_quantity
from jaxbiped.hybrid._hybrid_system import HybridSystem
from jaxbiped.scene._modes import AT_LIMIT, limit_motions, rigid_modes
from jaxbiped.scene._parameter_access import parameter_names, parameter_quantities, with_parameters
from jaxbiped.scene._placement import placement
from jaxbiped.scene._scene import (
    AbstractScene,
    AbstractWalkerScene,
    RigidScene,
    Scene,
    is_walker,
)
from jaxbiped.sweep._follow_starts import passes_a_stop

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
    names = recurring_names(scene.state_type)
    found: dict[str, str] = {}
    if not is_walker(scene):
        return found | {name: name for name in names}
    structure = scene.mechanism.structure
    swing, stance = (structure.bodies[j] for j in structure.roles)
    if {swing, stance} == {"1", "2"}:
        found = {
            name: name.replace("stance", stance).replace("swing", swing)
            for name in START_QUANTITIES
        }
    return found | {name: name for name in names}


def coordinate_names(scene: Scene | RigidScene | HybridSystem) -> tuple[str, ...]:
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


def coordinate_quantities(scene: Scene | RigidScene | HybridSystem) -> dict[str, Quantity]:
    """Words, symbol and unit of each coordinate in which starts of a scene can differ, by name.

    Args:
        scene: the walker, compliant or rigid, or a hybrid system.

    Returns:
        A `Quantity` (words, symbol and SI unit) for each name.
    """
    if is_walker(scene):
        own = {
            name: START_QUANTITIES.get(name) or state_quantity(name)
            for name in state_coordinates(scene)
        }
    else:
        units = getattr(scene.state_type, "own_units", {})
        own = {name: Quantity(name, unit=units.get(name, "")) for name in state_coordinates(scene)}
    return {name: each for name, each in own.items() if each} | parameter_quantities(scene)


def check_coordinates(scene: Scene | RigidScene | HybridSystem, names: Iterable[str]) -> None:
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


def _held_along(
    scene: AbstractWalkerScene, base: PyTree, states: PyTree, named: Collection[str]
) -> PyTree:
    """States in which the stops that the base holds are held, where they can be.

    Of two bodies that a stop holds, the one that is not `named` follows the other. What is off its
    limit then is not held; states that pass a stop are no numbers, so that they are told to fail.
    """
    modes, structure = rigid_modes(scene.mechanism), scene.mechanism.structure
    mode, values = modes.decoded(np, base.mode), states._asdict()
    for limit, stays in zip(modes.limits, mode.held, strict=True):
        names = [structure.bodies[j] for j, _ in limit.gap.weights]
        for kind in ("theta", "omega"):
            lead = [name for name in names if f"{kind}_{name}" in named]
            follow = [name for name in names if name not in lead]
            if len(lead) == len(follow) == 1:
                own, other = f"{kind}_{follow[0]}", f"{kind}_{lead[0]}"
                moved = getattr(base, own) + values[other] - getattr(base, other)
                values[own] = np.where(stays, moved, values[own])
    like, held = values["mode"], []
    motions = limit_motions(scene.mechanism, modes, scene.ground.slope, values)
    for (gap, rate), stays in zip(motions, mode.held, strict=True):
        near = np.abs(np.asarray(gap)) <= AT_LIMIT
        held.append(stays & near & (np.abs(rate) <= AT_LIMIT))
    passed = passes_a_stop(scene, values, by=AT_LIMIT)
    values["mode"] = modes.encoded(np, mode._replace(held=tuple(held)), like)
    return type(states)(**{name: np.where(passed, np.nan, each) for name, each in values.items()})


def place_states(
    scene: AbstractWalkerScene, base: PyTree, states: PyTree, named: Collection[str]
) -> PyTree:
    """States whose stance leg is as deep, and rolls and slips, as the base's does.

    The root point's height and velocity follow from the lowest foot of that leg where they are not
    `named`. A rigid walker's do anyway; there what the base holds moves along.
    """
    if not scene.compliant:
        stops = rigid_modes(scene.mechanism).limits
        return _held_along(scene, base, states, named) if stops else states
    mechanism = scene.mechanism
    structure = mechanism.structure
    root = (structure.coordinates[1], *structure.rates[:2])
    turning = (*structure.coordinates[2:], *structure.rates[2:])

    def rolling(state: PyTree) -> dict[str, np.ndarray]:
        given = {name: getattr(state, name) for name in turning}
        leg = structure.legs[structure.stance_leg]
        placed = placement(mechanism, scene.ground.slope, given, leg)
        return {name: np.asarray(placed[name]) for name in root}

    old, new = rolling(base), rolling(states)
    moved = {
        leaf: getattr(base, leaf) + new[leaf] - old[leaf] for leaf in root if leaf not in named
    }
    return states._replace(**moved)
