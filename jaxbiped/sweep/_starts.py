"""Where starts lie: on grids, in samples, or as given."""

import abc
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.tree_util as jtu
import numpy as np
from scipy.stats import qmc

from jaxbiped._checks import ArgumentError, check_choice, check_finite, check_positive
from jaxbiped.scene._parameters import with_parameters
from jaxbiped.scene._rigid_scene import RigidScene
from jaxbiped.scene._scene import Scene
from jaxbiped.sweep._coordinates import check_coordinates, parameters_among, placed, state_at
from jaxbiped.sweep._labelling import Labelling

SAMPLINGS = ("uniform", "latin-hypercube", "sobol", "halton")
"""Ways to draw samples."""


class Batch(NamedTuple):
    """Some of the starts: states and parameters as `Labelling` takes them, and coordinates."""

    states: Any
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
    def batch(self, labelling: Labelling, first: int, last: int) -> Batch:
        """The starts from number `first` up to `last`, in the order of the axes."""

    @abc.abstractmethod
    def described(self) -> dict[str, Any]:
        """What they are, ready for JSON."""

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """Parameters of the scene that differ on a grid, with their values: gaits are sought for
        every combination. Samples name none."""
        return {}

    @property
    def size(self) -> int:
        """How many there are."""
        return int(np.prod(self.shape))


class Grid(AbstractStarts):
    """A regular grid over coordinates; the last axis runs fastest. `grid` makes one.

    Attributes:
        values: coordinates' values, shape (k,) each.
        place: whether the stance foot is placed on the ground.
        follow: see `grid`.
    """

    values: dict[str, np.ndarray]
    place: bool
    follow: Callable[[Any, Any], Any] | None

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(values) for values in self.values.values())

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return dict(self.values)

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        return {name: np.unique(column) for name, column in parameters_among(self.values).items()}

    def batch(self, labelling: Labelling, first: int, last: int) -> Batch:
        places = np.unravel_index(np.arange(first, last), self.shape)
        pairs = zip(self.values.items(), places, strict=True)
        columns = {name: values[place] for (name, values), place in pairs}
        return batch_at(labelling, columns, place=self.place, follow=self.follow)

    def described(self) -> dict[str, Any]:
        values = {name: [float(x) for x in values] for name, values in self.values.items()}
        return {"grid": values, "place": self.place, "follow": _name_of(self.follow)}


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
    follow: Callable[[Any, Any], Any] | None

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.count,)

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return {"start": None}

    def batch(self, labelling: Labelling, first: int, last: int) -> Batch:
        points = self._points(first, last)
        columns = {
            name: self.lower[name] + points[:, i] * (self.upper[name] - self.lower[name])
            for i, name in enumerate(self.lower)
        }
        return batch_at(labelling, columns, place=self.place, follow=self.follow)

    def described(self) -> dict[str, Any]:
        bounds = {name: [self.lower[name], self.upper[name]] for name in self.lower}
        rest = {"place": self.place, "follow": _name_of(self.follow)}
        return {"sample": self.method, "count": self.count, "seed": self.seed} | bounds | rest

    def _points(self, first: int, last: int) -> np.ndarray:
        """In the unit cube, shape (last − first, d), whatever was drawn before."""
        dimensions, count = len(self.lower), last - first
        if self.method == "uniform":
            bits = np.random.Philox(self.seed)
            # One 64-bit word for each number; Philox counts in blocks of four.
            words, offset = first * dimensions, (first * dimensions) % 4
            bits.advance(words // 4)
            drawn = np.random.Generator(bits).random(offset + count * dimensions)
            return drawn[offset:].reshape(count, dimensions)
        if self.method == "latin-hypercube":
            # A permutation of all, which has to be drawn whole.
            return qmc.LatinHypercube(dimensions, rng=self.seed).random(self.count)[first:last]
        engine = qmc.Sobol if self.method == "sobol" else qmc.Halton
        sequence = engine(dimensions, scramble=True, rng=self.seed)
        if first:
            sequence.fast_forward(int(first))
        with warnings.catch_warnings():
            # A chunk is a piece of the sequence, whatever its length.
            warnings.filterwarnings("ignore", message="The balance properties")
            return sequence.random(count)


class GivenStarts(AbstractStarts):
    """Starts as they are given.

    Attributes:
        states: leaves of shape (n,).
    """

    states: Any

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.states.hip_x),)

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return {"start": None}

    def batch(self, labelling: Labelling, first: int, last: int) -> Batch:
        states = jtu.tree_map(lambda leaf: np.asarray(leaf)[first:last], self.states)
        return Batch(states, {}, states._asdict())

    def described(self) -> dict[str, Any]:
        return {"given": [np.asarray(leaf).tolist() for leaf in self.states]}


def grid(
    scene: Scene | RigidScene,
    values: Mapping[str, Sequence[float] | np.ndarray],
    *,
    place: bool = False,
    follow: Callable[[Any, Any], Any] | None = None,
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

    Raises:
        ArgumentError: an unknown coordinate, an empty axis, a value that is not finite.
    """
    check_coordinates(scene, values)
    if not values:
        raise ArgumentError("values = {} is empty: name at least one coordinate.")
    axes = {}
    for name, given in values.items():
        axis = np.atleast_1d(np.asarray(given, dtype=np.float64))
        if axis.ndim != 1 or not axis.size:
            raise ArgumentError(f"{name} has no values: give at least one.")
        check_finite(name, axis)
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
    follow: Callable[[Any, Any], Any] | None = None,
) -> Sample:
    """Random or quasi-random starts within bounds of coordinates (see `grid`).

    A start is the same whichever chunk it is made in. "latin-hypercube" draws all of them for each
    chunk; the other methods only the chunk's.

    Raises:
        ArgumentError: an unknown coordinate or method, bounds that enclose nothing, no starts.
    """
    check_coordinates(scene, bounds)
    check_positive("count", count)
    check_choice("method", method, SAMPLINGS)
    if not bounds:
        raise ArgumentError("bounds = {} is empty: name at least one coordinate.")
    for name, (low, high) in bounds.items():
        check_finite(name, (low, high))
        if not low < high:
            raise ArgumentError(f"{name} = {low:g}:{high:g} is empty: the first must be less.")
    lower = {name: float(low) for name, (low, _) in bounds.items()}
    upper = {name: float(high) for name, (_, high) in bounds.items()}
    _check_parameters(scene, {name: np.array([lower[name], upper[name]]) for name in lower})
    return Sample(lower, upper, int(count), method, int(seed), place, follow)


def batch_at(
    labelling: Labelling,
    columns: dict[str, np.ndarray],
    *,
    place: bool = False,
    follow: Callable[[Any, Any], Any] | None = None,
) -> Batch:
    """The starts at these coordinates, each (n,); `place` and `follow` as in `grid`."""
    count = len(next(iter(columns.values())))
    parameters = parameters_among(columns)
    base = labelling.base(parameters, count)
    scene = with_parameters(labelling.scene, parameters)
    states = state_at(base, columns)
    if place:
        states = placed(scene, base, states, columns)
    if follow is not None:
        states = follow(scene, states)
    leaves = [np.broadcast_to(np.asarray(leaf, dtype=np.float64), (count,)) for leaf in states]
    return Batch(type(states)(*leaves), parameters, columns)


def _check_parameters(scene: Scene | RigidScene, columns: dict[str, np.ndarray]) -> None:
    """Raises `ArgumentError` for values that the scene's parameters must not have."""
    for name, column in parameters_among(columns).items():
        with_parameters(scene, {name: column})


def _name_of(follow: Callable[[Any, Any], Any] | None) -> str | None:
    return None if follow is None else f"{follow.__module__}.{follow.__qualname__}"
