"""Samples of starts: each is a point of a sequence, a function of its number alone."""

import warnings
from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import PyTree

from jaxbiped._checks import ArgumentError, check_choice, check_count, check_finite
from jaxbiped._types import JsonObject
from jaxbiped.caching._caches import bounded_cache
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep.starts._coordinates import check_coordinates
from jaxbiped.sweep.starts._starts import (
    AbstractStarts,
    Batch,
    Completion,
    Rest,
    batch_at,
    check_parameters,
    rest_of,
)

SAMPLINGS = ("uniform", "latin-hypercube", "sobol", "halton")
"""Ways to draw samples."""
MOST_SOBOL = 1 << 30
"""Points of SciPy's Sobol sequence."""


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
    scene: Scene | RigidScene,
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
        scene: the walker.
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
