"""Lattices of a grid, coarse to fine, in waves: no point of a wave needs another.

A coarse lattice comes first, breadth first from one point; then each finer one at once, between
points that are known.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

Place: TypeAlias = tuple[int, ...]
"""Indices of a point."""

LARGE = 64
"""Points from which on a grid is large."""
_COARSEST = 12
"""Points of the coarse lattice along the longest axis, about."""
_STENCILS: tuple[dict[int, float], ...] = (
    {-3: -1 / 16, -1: 9 / 16, 1: 9 / 16, 3: -1 / 16},
    {-1: 0.5, 1: 0.5},
    {-1: 1.5, -3: -0.5},
    {1: 1.5, 3: -0.5},
    {-1: 1.0},
    {1: 1.0},
)
"""Weights of points so many steps away for the point between them, the best first."""


class Wave(NamedTuple):
    """Points none of which needs another.

    Attributes:
        places: the points.
        stride: steps along an axis between neighbours on the wave's lattice.
        fills: whether the points lie between those of the lattice that is twice as coarse; else
            beyond those of the waves before.
    """

    places: list[Place]
    stride: int
    fills: bool


def waves(shape: Sequence[int], first: Place) -> list[Wave]:
    """All points of a grid in the order in which they are searched; `first` is the first wave."""
    stride = 1
    if np.prod(shape) >= LARGE:
        while 2 * stride * _COARSEST <= max(shape):
            stride *= 2
    found = [Wave(each, stride, False) for each in rings(shape, first, stride)]
    while stride > 1:
        stride //= 2
        coarser = set(_lattice(shape, first, 2 * stride))
        places = [place for place in _lattice(shape, first, stride) if place not in coarser]
        found.append(Wave(places, stride, True))
    return found


def neighbours(place: Place, shape: Sequence[int], stride: int = 1) -> Iterator[Place]:
    """The points next to one, one axis after the other."""
    for axis, size in enumerate(shape):
        for step in (-stride, stride):
            moved = place[axis] + step
            if 0 <= moved < size:
                yield (*place[:axis], moved, *place[axis + 1 :])


def rings(shape: Sequence[int], first: Place, stride: int = 1) -> Iterator[list[Place]]:
    """The lattice's points by how many strides they are away."""
    seen, ring = {first}, [first]
    while ring:
        yield ring
        following = []
        for place in ring:
            for near in neighbours(place, shape, stride):
                if near not in seen:
                    seen.add(near)
                    following.append(near)
        ring = following


def extrapolated(states: np.ndarray, wave: Wave) -> np.ndarray:
    """Where the points of a wave beyond the known ones may lie: on from the nearest two, or one.

    `states` has shape (*grid, m), NaN where nothing is known; the result (n, m).
    """
    shape = states.shape[:-1]
    found = np.full((len(wave.places), states.shape[-1]), np.nan)
    for k, place in enumerate(wave.places):
        best = None
        for near in neighbours(place, shape, wave.stride):
            if np.isnan(states[near][0]):
                continue
            beyond = tuple(2 * a - b for a, b in zip(near, place, strict=True))
            inside = all(0 <= i < size for i, size in zip(beyond, shape, strict=True))
            if inside and not np.isnan(states[beyond][0]):
                best = 2.0 * states[near] - states[beyond]
                break
            best = states[near] if best is None else best
        if best is not None:
            found[k] = best
    return found


def interpolated(states: np.ndarray, first: Place, wave: Wave) -> np.ndarray:
    """Where the points of a wave between the known ones may lie, as `extrapolated`.

    By cubic polynomials along one axis after the other, by lower ones where points are missing.
    """
    coarse = np.full_like(states, np.nan)
    known = tuple(slice(i % (2 * wave.stride), None, 2 * wave.stride) for i in first)
    coarse[known] = states[known]
    for axis, begin in enumerate(first):
        rows = np.moveaxis(coarse, axis, 0)[begin % wave.stride :: wave.stride]
        odd = (begin // wave.stride + 1) % 2
        rows[odd::2] = _between(rows, odd)
    return coarse[tuple(np.transpose(wave.places))]


def _between(rows: np.ndarray, odd: int) -> np.ndarray:
    """Values in every second row, from `odd` on, by the rows between them."""
    margin = np.full((3, *rows.shape[1:]), np.nan)
    padded = np.concatenate([margin, rows, margin])
    count = len(rows[odd::2])
    best = np.full((count, *rows.shape[1:]), np.nan)
    for stencil in _STENCILS:
        value = sum(
            weight * padded[3 + odd + step : 3 + odd + step + 2 * count - 1 : 2]
            for step, weight in stencil.items()
        )
        best = np.where(np.isnan(best), value, best)
    return best


def _lattice(shape: Sequence[int], first: Place, stride: int) -> Iterator[Place]:
    axes = [range(i % stride, size, stride) for i, size in zip(first, shape, strict=True)]
    return itertools.product(*axes)
