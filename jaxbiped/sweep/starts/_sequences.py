"""Sequences of points in the unit cube, each a function of its number alone."""

import warnings
from collections.abc import Iterator

import numpy as np

from jaxbiped.caching._caches import bounded_cache

SAMPLINGS = ("uniform", "latin-hypercube", "sobol", "halton")
"""Ways to draw samples."""
MOST_SOBOL = 1 << 30
"""Points of SciPy's Sobol sequence."""


def sequence_points(
    method: str, dimensions: int, count: int, seed: int, numbers: np.ndarray
) -> np.ndarray:
    """The points with these numbers of a sample of `count`, whatever else is drawn.

    Args:
        method: one of `SAMPLINGS`.
        dimensions: d of the cube.
        count: size of the whole sample.
        seed: of the sequence.
        numbers: increasing, shape (n,).

    Returns:
        Shape (n, d).
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
