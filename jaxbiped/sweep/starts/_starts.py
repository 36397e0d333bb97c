"""Starts on grids and in samples."""

import abc
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_finite
from jaxbiped._identity import identity
from jaxbiped._types import JsonObject
from jaxbiped.basins._arguments import check_whole
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep.starts._coordinates import (
    check_coordinates,
    parameters_among,
    place_states,
    state_at,
)
from jaxbiped.sweep.starts._sequences import MOST_SOBOL, SAMPLINGS, sequence_points

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


class Sample(AbstractStarts):
    """Random or quasi-random starts within bounds. `sample` makes one.

    Attributes:
        lower, upper: bounds of each coordinate.
        count: how many starts.
        method: one of `SAMPLINGS`.
        seed: of the sequence.
        place, follow: as in `Grid`.
    """

    lower: dict[str, float]
    upper: dict[str, float]
    count: int
    method: str
    seed: int
    place: bool
    follow: Completion | None

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.count,)

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return {"start": None}

    @property
    def own_columns(self) -> tuple[str, ...]:
        return tuple(self.lower)

    def at(self, labelling: Labelling, numbers: np.ndarray) -> Batch:
        drawn = sequence_points(self.method, len(self.lower), self.count, self.seed, numbers)
        columns = {
            name: self.lower[name] + drawn[:, i] * (self.upper[name] - self.lower[name])
            for i, name in enumerate(self.lower)
        }
        return batch_at(labelling, columns, place=self.place, follow=self.follow)

    def described(self) -> JsonObject:
        bounds = {name: [self.lower[name], self.upper[name]] for name in self.lower}
        rest = {"place": self.place, "follow": identity(self.follow)}
        drawn = {"sample": self.method, "count": self.count, "seed": self.seed}
        return drawn | {"bounds": bounds} | rest


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
        axis = np.atleast_1d(np.asarray(given, dtype=np.float64))
        if axis.ndim != 1 or not axis.size:
            raise ArgumentError(
                f"{name} has values of shape {axis.shape}: it must be (k,), k at least 1."
            )
        axes[name] = axis
    _check_parameters(scene, axes)
    return Grid(axes, place, follow)


def sample(
    scene: Scene | RigidScene,
    bounds: Mapping[str, tuple[float, float]],
    count: int,
    *,
    method: str = "sobol",
    seed: int = 0,
    place: bool = False,
    follow: Completion | None = None,
) -> Sample:
    """Random or quasi-random starts within bounds of coordinates (see `grid`).

    A start is the same whichever chunk it is made in. "latin-hypercube" draws all of them for each
    chunk; the other methods only the chunk's.

    Args:
        scene: the walker.
        bounds: lower and upper bound of each coordinate (see `coordinate_names`), in its SI unit.
        count: how many starts.
        method: one of `SAMPLINGS`.
        seed: of the random numbers.
        place, follow: as in `grid`.

    Returns:
        The starts, of shape (count,); none is computed before it is labelled.

    Raises:
        ArgumentError: an unknown coordinate or method, bounds that enclose nothing, no starts.
    """
    check_coordinates(scene, bounds)
    check_whole("count", count, 1)
    check_whole("seed", seed, 0)
    check_choice("method", method, SAMPLINGS)
    if method == "sobol" and count > MOST_SOBOL:
        raise ArgumentError(
            f"count = {count} is not allowed for sobol: its sequence has {MOST_SOBOL} points."
        )
    if not bounds:
        raise ArgumentError("bounds = {} is empty: name at least one coordinate.")
    for name, pair in bounds.items():
        check_finite(name, pair)
        if np.shape(pair) != (2,):
            raise ArgumentError(f"{name} = {pair!r} is not allowed: give two numbers, its bounds.")
        low, high = pair
        if not low < high:
            raise ArgumentError(
                f"{name} = {low:g}:{high:g} is not allowed: the first must be less than the second."
            )
    lower = {name: float(low) for name, (low, _) in bounds.items()}
    upper = {name: float(high) for name, (_, high) in bounds.items()}
    _check_parameters(scene, {name: np.array([lower[name], upper[name]]) for name in lower})
    return Sample(lower, upper, int(count), method, int(seed), place, follow)


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


def _check_parameters(scene: Scene | RigidScene, columns: dict[str, np.ndarray]) -> None:
    """Raises `ArgumentError` for values that the scene's parameters must not have."""
    for name, column in parameters_among(columns).items():
        with_parameters(scene, {name: column})
