"""Starts of a sweep: on grids, or as they are given."""

import abc
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_finite, check_type
from jaxbiped._identity import identity
from jaxbiped._types import JsonObject
from jaxbiped.dynamics._state import BristleState, RigidState, State
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.sweep._labelling import Labelling, check_leaves_of_starts
from jaxbiped.sweep.starts._coordinates import (
    axis_values,
    check_coordinates,
    parameters_among,
    place_states,
    state_at,
)

Completion: TypeAlias = Callable[[Any, PyTree], PyTree]
"""Completes starts: of a scene and its states, leaves (n,)."""


class Batch(NamedTuple):
    """Some of the starts: states and parameters as `Labelling` takes them, and coordinates."""

    states: PyTree
    parameters: dict[str, np.ndarray]
    columns: dict[str, np.ndarray]


class AbstractStarts(eqx.Module):
    """Starts that are made as they are needed: each is a function of its number alone."""

    @property
    @abc.abstractmethod
    def shape(self) -> tuple[int, ...]:
        """How many there are along each axis."""

    @property
    @abc.abstractmethod
    def axes(self) -> dict[str, np.ndarray | None]:
        """The axes by name, with their coordinates where they have such."""

    @abc.abstractmethod
    def at(self, labelling: Labelling, numbers: np.ndarray) -> Batch:
        """The starts with these numbers, increasing, in the order of the axes; shape (n,)."""

    @property
    @abc.abstractmethod
    def own_columns(self) -> tuple[str, ...]:
        """Coordinates that each start has for itself, of which no axis tells."""

    @abc.abstractmethod
    def described(self) -> JsonObject:
        """What they are, ready for JSON."""

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """Parameters of the scene that differ on a grid, with their values: gaits are sought for
        every combination. Samples name none."""
        return {}

    @property
    def size(self) -> int:
        """How many there are."""
        return math.prod(self.shape)

    def batch(self, labelling: Labelling, first: int, last: int) -> Batch:
        """The starts from number `first` up to `last`."""
        return self.at(labelling, np.arange(first, last))


class Grid(AbstractStarts):
    """A regular grid over coordinates; the last axis runs fastest. `grid` makes one.

    Attributes:
        values: coordinates' values, shape (k,) each.
        place: whether the stance foot is placed on the ground.
        follow: see `grid`.
    """

    values: dict[str, np.ndarray]
    place: bool
    follow: Completion | None

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(values) for values in self.values.values())

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return dict(self.values)

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        return {name: np.unique(column) for name, column in parameters_among(self.values).items()}

    @property
    def own_columns(self) -> tuple[str, ...]:
        return ()

    def at(self, labelling: Labelling, numbers: np.ndarray) -> Batch:
        places = np.unravel_index(numbers, self.shape)
        pairs = zip(self.values.items(), places, strict=True)
        columns = {name: values[place] for (name, values), place in pairs}
        return batch_at(labelling, columns, place=self.place, follow=self.follow)

    def described(self) -> JsonObject:
        values = {name: [float(x) for x in values] for name, values in self.values.items()}
        return {"grid": values, "place": self.place, "follow": identity(self.follow)}


def grid(
    scene: Scene | RigidScene,
    values: Mapping[str, Sequence[float] | np.ndarray],
    *,
    place: bool = False,
    follow: Completion | None = None,
) -> Grid:
    """A regular grid of starts over coordinates of the state and parameters of the scene.

    Args:
        scene: the walker.
        values: of each coordinate (see `coordinate_names`), the last one running fastest. What is
            not named keeps the value that the gait has on its section.
        place: whether the stance foot is placed on the ground: hip height and velocity, where they
            are not named, follow from the stance leg as deep and as slowly slipping as in the gait.
        follow: a function of (scene, states), leaves (n,), that completes the starts in another
            way, after all else. For workers in other processes it must be a module's own.

    Returns:
        The starts, of the shape that the axes span; none is computed before it is labelled.

    Raises:
        ArgumentError: an unknown coordinate, an empty axis, a value that is not finite.

    Examples:
        >>> import jaxbiped as jb
        >>> axes = {"theta_stance": [0.10, 0.15, 0.20], "omega_stance": [-1.4, -1.2]}
        >>> jb.starts.grid(jb.seed_scene(), axes).size
        6
    """
    check_coordinates(scene, values)
    if not values:
        raise ArgumentError("values = {} is empty: name at least one coordinate.")
    axes = {}
    for name, given in values.items():
        check_finite(name, given)
        axes[name] = axis_values(name, np.atleast_1d(given))
    check_parameters(scene, axes)
    return Grid(axes, place, follow)


def batch_at(
    labelling: Labelling,
    columns: dict[str, np.ndarray],
    *,
    place: bool = False,
    follow: Completion | None = None,
) -> Batch:
    """The starts at these coordinates, each (n,); `place` and `follow` as in `grid`."""
    count = len(next(iter(columns.values())))
    parameters = parameters_among(columns)
    base = labelling.base(parameters, count)
    scene = with_parameters(labelling.scene, parameters)
    states = state_at(base, columns)
    if place:
        states = place_states(scene, base, states, columns)
    if follow is not None:
        states = follow(scene, states)
    leaves = [np.broadcast_to(np.asarray(leaf, dtype=np.float64), (count,)) for leaf in states]
    return Batch(type(states)(*leaves), parameters, columns)


def check_parameters(scene: Scene | RigidScene, columns: dict[str, np.ndarray]) -> None:
    """Raises `ArgumentError` for values that the scene's parameters must not have."""
    for name, column in parameters_among(columns).items():
        with_parameters(scene, {name: column})


class GivenStarts(AbstractStarts):
    """Starts as they are given.

    Attributes:
        states: `State`, `BristleState` or `RigidState` with leaves of shape (n,).

    Raises:
        ArgumentError: a state of another kind, or leaves of different shapes.
    """

    states: PyTree

    def __check_init__(self) -> None:
        check_type("states", self.states, State, BristleState, RigidState)
        check_leaves_of_starts(self.states)

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.states.hip_x),)

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return {"start": None}

    @property
    def own_columns(self) -> tuple[str, ...]:
        return tuple(self.states._fields)

    def at(self, labelling: Labelling, numbers: np.ndarray) -> Batch:
        states = jtu.tree_map(lambda leaf: np.asarray(leaf, np.float64)[numbers], self.states)
        return Batch(states, {}, states._asdict())

    def described(self) -> JsonObject:
        digest = hashlib.sha256()
        for leaf in self.states:
            digest.update(np.ascontiguousarray(leaf, dtype=np.float64).tobytes())
        return {"given": self.size, "sha256": digest.hexdigest()}

    def between(self, first: int, last: int) -> "GivenStarts":
        """Those from number `first` up to `last` alone."""
        return GivenStarts(jtu.tree_map(lambda leaf: np.asarray(leaf)[first:last], self.states))
