"""Array primitives of JAX: those that move, combine and sum the elements of small arrays."""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from jaxbiped.compiler.ir._elementwise_primitives import ELEMENTWISE, Array, array_of, elementwise
from jaxbiped.compiler.ir._graph import Block

_Axes: TypeAlias = tuple[Sequence[int], Sequence[int]]
DotDimensions: TypeAlias = tuple[_Axes, _Axes]
"""Axes of either array that `dot_general` sums over, and those of its batch."""


def _broadcast(
    a: Array, *, shape: tuple[int, ...], broadcast_dimensions: Sequence[int], **_: object
) -> Array:
    places = [1] * len(shape)
    for size, axis in zip(a.shape, broadcast_dimensions, strict=True):
        places[axis] = size
    return np.broadcast_to(a.reshape(places), shape)


def _slice(
    a: Array,
    *,
    start_indices: Sequence[int],
    limit_indices: Sequence[int],
    strides: Sequence[int] | None,
    **_: object,
) -> Array:
    steps = strides or [1] * a.ndim
    parts = zip(start_indices, limit_indices, steps, strict=True)
    return a[tuple(slice(*part) for part in parts)]


def padded(value: np.ndarray, fill: Any, config: Sequence[tuple[int, int, int]]) -> np.ndarray:
    """An array with room of `fill` before, behind and between its entries, along each axis.

    Where the room is negative, entries are cut off.
    """
    sizes = [
        low + high + n + max(0, n - 1) * between
        for n, (low, high, between) in zip(value.shape, config, strict=True)
    ]
    whole = np.full([max(0, n) for n in sizes], fill, value.dtype)
    source, target = [], []
    for n, size, (low, _, between) in zip(value.shape, sizes, config, strict=True):
        places = low + np.arange(n) * (1 + between)
        inside = (places >= 0) & (places < size)
        source.append(np.flatnonzero(inside))
        target.append(places[inside])
    whole[np.ix_(*target)] = value[np.ix_(*source)]
    return whole


def iota(
    *, shape: tuple[int, ...], dimension: int, dtype: npt.DTypeLike, **_: object
) -> np.ndarray:
    """Places along one axis, as numbers."""
    places = [1] * len(shape)
    places[dimension] = -1
    return np.broadcast_to(np.arange(shape[dimension], dtype=dtype).reshape(places), shape)


MOVES: dict[str, Callable[..., Array | list[Array]]] = {
    "broadcast_in_dim": _broadcast,
    "reshape": lambda a, *, new_sizes, **_: a.reshape(new_sizes),
    "squeeze": lambda a, *, dimensions, **_: np.squeeze(a, axis=tuple(dimensions)),
    "expand_dims": lambda a, *, dimensions, **_: np.expand_dims(a, tuple(dimensions)),
    "transpose": lambda a, *, permutation, **_: np.transpose(a, permutation),
    "slice": _slice,
    "concatenate": lambda *arrays, dimension, **_: np.concatenate(arrays, axis=dimension),
    "pad": lambda a, fill, *, padding_config, **_: padded(a, fill.item(), padding_config),
    "stack": lambda *arrays, axis=0, **_: np.stack(arrays, axis=axis),
    "rev": lambda a, *, dimensions, **_: np.flip(a, tuple(dimensions)),
    "split": lambda a, *, sizes, axis, **_: np.split(a, np.cumsum(sizes)[:-1], axis),
    "unstack": lambda a, *, axis, **_: [
        np.asarray(part, object) for part in np.moveaxis(a, axis, 0)
    ],
}


REDUCTIONS = {
    "reduce_sum": "add",
    "reduce_prod": "mul",
    "reduce_max": "max",
    "reduce_min": "min",
    "reduce_and": "and",
    "reduce_or": "or",
}


def reduce(block: Block, name: str, a: Array, axes: Sequence[int]) -> Array:
    """An array reduced over axes."""
    combine = functools.partial(ELEMENTWISE[REDUCTIONS[name]], block)
    rest = [size for axis, size in enumerate(a.shape) if axis not in axes]
    flat = np.moveaxis(a, tuple(axes), tuple(range(len(axes)))).reshape(-1, *rest)
    total = flat[0] if rest else array_of([flat[0]], ())
    for part in flat[1:]:
        total = elementwise(combine, total, part if rest else array_of([part], ()))
    return total


def product(
    block: Block, a: Array, b: Array, *, dimension_numbers: DotDimensions, **_: object
) -> Array:
    """`dot_general`, every sum written out."""
    (a_summed, b_summed), (a_batch, b_batch) = dimension_numbers

    def ordered(array: Array, first: Sequence[int], last: Sequence[int]) -> tuple[Array, list[int]]:
        free = [axis for axis in range(array.ndim) if axis not in (*first, *last)]
        sizes = [array.shape[axis] for axis in free]
        moved = np.transpose(array, (*first, *free, *last))
        count, terms = (math.prod(array.shape[axis] for axis in axes) for axes in (first, last))
        return moved.reshape(count, math.prod(sizes), terms), sizes

    left, left_sizes = ordered(a, a_batch, a_summed)
    right, right_sizes = ordered(b, b_batch, b_summed)
    multiply, add = (functools.partial(ELEMENTWISE[name], block) for name in ("mul", "add"))
    found = [
        functools.reduce(add, [multiply(x, y) for x, y in zip(row, column, strict=True)])
        for rows, columns in zip(left, right, strict=True)
        for row in rows
        for column in columns
    ]
    batch = [a.shape[axis] for axis in a_batch]
    return array_of(found, (*batch, *left_sizes, *right_sizes))
