"""Starts of a sweep: on grids, sampled, or given. Each is a function of its number alone."""

import abc
import hashlib
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_finite, check_type
from jaxbiped._identity import identity
from jaxbiped._types import JsonObject
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.dynamics._state import state_for
from jaxbiped.hybrid._walker_systems import system_of
from jaxbiped.scene._parameter_access import with_parameters
from jaxbiped.scene._scene import AbstractScene
from jaxbiped.scene._state_types import State
from jaxbiped.sweep._follow_starts import broadcast_leaves
from jaxbiped.sweep._labelling import Labelling, check_leaves_of_starts
from jaxbiped.sweep.starts._coordinates import (
    axis_values,
    check_coordinates,
    parameters_among,
    state_at,
)

SAMPLINGS = ("uniform", "latin-hypercube", "sobol", "halton")
"""Ways to draw samples."""
MOST_SOBOL = 1 << 30
"""Points of SciPy's Sobol sequence."""
Completion: TypeAlias = Callable[[Any, PyTree], PyTree]
"""Completes starts: of a scene and its states, leaves (n,)."""


class Batch(NamedTuple):
    """Some of the starts: states and parameters as `Labelling` takes them, and coordinates."""

    states: PyTree
    parameters: dict[str, np.ndarray]
    columns: dict[str, np.ndarray]


class AbstractStarts(eqx.Module):
    """Starts that are computed when needed: each is a function of its number alone."""

    @property
    @abc.abstractmethod
    def shape(self) -> tuple[int, ...]:
        """How many there are along each axis."""

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        """The axes by name, with their coordinates where they have such; by default one without."""
        return {"start": None}

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


class Rest(eqx.Module):
    """Where what starts do not name comes from; see `grid`.

    Attributes:
        place: whether the stance leg is placed on the ground.
        follow: what completes the starts; None for nothing.
        base: the state that they are changed from; None for the gait's.
    """

    place: bool
    follow: Completion | None
    base: PyTree

    def described(self) -> JsonObject:
        """What it is, ready for JSON."""
        own = {"place": self.place, "follow": identity(self.follow)}
        if self.base is None:
            return own
        return own | {"base": {name: float(x) for name, x in self.base._asdict().items()}}


def rest_of(
    scene: AbstractScene,
    names: Iterable[str],
    place: bool | None,
    follow: Completion | None,
    base: PyTree,
) -> Rest:
    """Where starts that name these coordinates have the rest from; raises `ArgumentError`."""
    if base is not None:
        base = state_for(scene, base, "base")
        if np.ndim(base[0]):
            raise ArgumentError(
                f"base has leaves of shape {np.shape(base[0])}, which is not allowed: give one "
                "state."
            )
        base = type(base)(*map(float, base))
    posture = scene.posture
    if place and not posture:
        raise ArgumentError(
            f"place = {place!r} is not allowed for a {type(scene).__name__}, which has no leg to "
            "place: leave it out, and complete starts by follow."
        )
    if place is None:
        place = not set(posture).isdisjoint(names)
    return Rest(bool(place), follow, base)


class Grid(AbstractStarts):
    """A regular grid over coordinates; the last axis runs fastest. `grid` makes one.

    Attributes:
        values: values of the coordinates, arrays of shape (k,).
        rest: source of the coordinates that are not named.
        swept: which of the coordinates are parameters of the scene.
    """

    values: dict[str, np.ndarray]
    rest: Rest
    swept: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(values) for values in self.values.values())

    @property
    def axes(self) -> dict[str, np.ndarray | None]:
        return dict(self.values)

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        return {name: np.unique(self.values[name]) for name in self.swept}

    @property
    def own_columns(self) -> tuple[str, ...]:
        return ()

    def at(self, labelling: Labelling, numbers: np.ndarray) -> Batch:
        places = np.unravel_index(numbers, self.shape)
        pairs = zip(self.values.items(), places, strict=True)
        columns = {name: values[place] for (name, values), place in pairs}
        return batch_at(labelling, columns, self.rest)

    def described(self) -> JsonObject:
        values = {name: [float(x) for x in values] for name, values in self.values.items()}
        return {"grid": values} | self.rest.described()


def grid(
    scene: AbstractScene,
    values: Mapping[str, Sequence[float] | np.ndarray],
    *,
    place: bool | None = None,
    follow: Completion | None = None,
    base: PyTree = None,
) -> Grid:
    """A regular grid of starts over coordinates of the state and parameters of the scene.

    Args:
        scene: the walker, or a hybrid system.
        values: values of each coordinate (see `coordinate_names`); the last one runs fastest.
        place: whether the stance leg is placed on the ground: unless they are named, height and
            velocity of the root point then follow from its lowest foot, with the penetration and
            slip speed of the gait, or of the base. Default: if an axis is an angle or rate of a
            body under its name in the state, whereas `theta_stance` and similar names give a slice
            with the gait's own root point. A hybrid system has nothing to place.
        follow: a function of (scene, states), with leaves of shape (n,), that finally modifies the
            starts. For workers in other processes, it must be defined in a module.
        base: a state of the scene that provides the coordinates that are not named. Default: the
            gait's state on its section.

    Returns:
        The starts, with the shape of the axes; each is computed when it is labelled.

    Raises:
        ArgumentError: a coordinate is unknown or named twice, an axis is empty, a value is not
            finite, or the base is of another kind.

    Examples:
        >>> import jaxbiped as jb
        >>> axes = {"theta_stance": [0.10, 0.15, 0.20], "omega_stance": [-1.4, -1.2]}
        >>> jb.starts.grid(jb.seed_scene(), axes).size
        6
    """
    check_coordinates(scene, values)
    if not values:
        raise ArgumentError("values = {} is empty: name at least one coordinate.")
    axes = {name: axis_values(name, np.atleast_1d(given)) for name, given in values.items()}
    check_parameters(scene, axes)
    swept = tuple(parameters_among(scene, axes))
    return Grid(axes, rest_of(scene, axes, place, follow, base), swept)


def batch_at(
    labelling: Labelling,
    columns: dict[str, np.ndarray],
    rest: Rest,
) -> Batch:
    """The starts at these coordinates, each (n,)."""
    count = len(next(iter(columns.values())))
    parameters = parameters_among(labelling.scene, columns)
    if rest.base is None:
        base = labelling.base(parameters, count)
    else:
        base = broadcast_leaves(rest.base, count)
    scene = with_parameters(labelling.scene, parameters)
    states = state_at(scene, base, columns)
    if rest.place:
        states = system_of(scene).placed_like(scene, base, states, columns)
    if rest.follow is not None:
        states = rest.follow(scene, states)
    leaves = [np.broadcast_to(np.asarray(leaf, dtype=np.float64), (count,)) for leaf in states]
    return Batch(type(states)(*leaves), parameters, columns)


def check_parameters(scene: AbstractScene, columns: dict[str, np.ndarray]) -> None:
    """Raises `ArgumentError` for values that the scene's parameters must not have."""
    for name, column in parameters_among(scene, columns).items():
        with_parameters(scene, {name: column})


class GivenStarts(AbstractStarts):
    """Starts given as states.

    Attributes:
        states: a state of the scene's kind with leaves of shape (n,).

    Raises:
        ArgumentError: the state is of another kind, or its leaves have different shapes.
    """

    states: PyTree

    def __check_init__(self) -> None:
        if not hasattr(self.states, "_fields"):  # of which kind, the labelling knows
            check_type("states", self.states, State)
        check_leaves_of_starts(self.states)

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.states[0]),)

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


def sequence_points(
    method: str, dimensions: int, count: int, seed: int, numbers: np.ndarray
) -> np.ndarray:
    """The points with these numbers of a sample of `count` in a cube, whatever else is drawn.

    `numbers` increase, shape (n,); the points have shape (n, dimensions).
    """
    if method == "latin-hypercube":
        return np.asarray(_latin_hypercube(dimensions, count, seed)[numbers])
    if method == "uniform":
        parts = [_uniform(dimensions, seed, *run) for run in _runs(numbers)]
    else:
        from scipy.stats import qmc

        engine = qmc.Sobol if method == "sobol" else qmc.Halton
        sequence = engine(dimensions, scramble=True, rng=seed)
        parts, reached = [], 0
        for first, last in _runs(numbers):
            if first > reached:
                sequence.fast_forward(first - reached)
            with warnings.catch_warnings():
                # Sobol's balance holds for powers of two, and a chunk need not be one.
                warnings.simplefilter("ignore", UserWarning)
                parts.append(sequence.random(last - first))
            reached = last
    return np.concatenate([np.zeros((0, dimensions)), *parts])


def _runs(numbers: np.ndarray) -> Iterator[tuple[int, int]]:
    """The first and the one after the last of numbers that follow each other."""
    if len(numbers):
        for run in np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1):
            yield int(run[0]), int(run[-1]) + 1


def _uniform(dimensions: int, seed: int, first: int, last: int) -> np.ndarray:
    bits = np.random.Philox(seed)
    # One 64-bit word for each number; Philox counts in blocks of four.
    words, offset = first * dimensions, (first * dimensions) % 4
    bits.advance(words // 4)
    drawn = np.random.Generator(bits).random(offset + (last - first) * dimensions)
    return drawn[offset:].reshape(last - first, dimensions)


@bounded_cache(1)
def _latin_hypercube(dimensions: int, count: int, seed: int) -> np.ndarray:
    """All of them: each dimension is a permutation, which has to be drawn whole."""
    from scipy.stats import qmc

    drawn = qmc.LatinHypercube(dimensions, rng=seed).random(count)
    drawn.setflags(write=False)
    return drawn


class Sample(AbstractStarts):
    """Random or quasi-random starts within bounds. `sample` makes one.

    Attributes:
        lower, upper: lower and upper bound of each coordinate.
        count: how many starts.
        method: one of `SAMPLINGS`.
        seed: random seed of the sequence.
        rest: as in `Grid`.
    """

    lower: dict[str, float]
    upper: dict[str, float]
    count: int
    method: str
    seed: int
    rest: Rest

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.count,)

    @property
    def own_columns(self) -> tuple[str, ...]:
        return tuple(self.lower)

    def at(self, labelling: Labelling, numbers: np.ndarray) -> Batch:
        drawn = sequence_points(self.method, len(self.lower), self.count, self.seed, numbers)
        columns = {
            name: self.lower[name] + drawn[:, i] * (self.upper[name] - self.lower[name])
            for i, name in enumerate(self.lower)
        }
        return batch_at(labelling, columns, self.rest)

    def described(self) -> JsonObject:
        bounds = {name: [self.lower[name], self.upper[name]] for name in self.lower}
        drawn = {"sample": self.method, "count": self.count, "seed": self.seed}
        return drawn | {"bounds": bounds} | self.rest.described()


def sample(
    scene: AbstractScene,
    bounds: Mapping[str, tuple[float, float]],
    count: int,
    *,
    method: str = "sobol",
    seed: int = 0,
    place: bool | None = None,
    follow: Completion | None = None,
    base: PyTree = None,
) -> Sample:
    """Random or quasi-random starts within bounds of coordinates (see `grid`).

    A start does not depend on its chunk. "latin-hypercube" draws all starts for each chunk; the
    other methods draw only those of the chunk.

    Args:
        scene: the walker, or a hybrid system.
        bounds: lower and upper bound of each coordinate (see `coordinate_names`), in its SI unit.
        count: how many starts.
        method: one of `SAMPLINGS`.
        seed: random seed.
        place, follow, base: as in `grid`.

    Returns:
        The starts, of shape (count,); each is computed when it is labelled.

    Raises:
        ArgumentError: a coordinate or method is unknown, bounds are empty, or there are no starts.
    """
    check_coordinates(scene, bounds)
    check_count("count", count)
    check_count("seed", seed, 0)
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
    check_parameters(scene, {name: np.array([lower[name], upper[name]]) for name in lower})
    rest = rest_of(scene, bounds, place, follow, base)
    return Sample(lower, upper, int(count), method, int(seed), rest)
