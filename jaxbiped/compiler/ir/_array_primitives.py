"""Array primitives of JAX: those that move, combine and sum the elements of small arrays."""

import functools
import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

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


def _pad(
    a: Array, filler: Array, *, padding_config: Sequence[tuple[int, int, int]], **_: object
) -> Array:
    """Filled up before, behind and between the entries; cut off where the filling is negative."""
    for axis, (before, behind, between) in enumerate(padding_config):
        size = (a.shape[axis] - 1) * (between + 1) + 1 if a.shape[axis] else 0
        shape = list(a.shape)
        shape[axis] = max(before, 0) + size + max(behind, 0)
        whole = np.full(shape, filler.item(), dtype=object)
        rows = np.moveaxis(whole, axis, 0)
        rows[max(before, 0) : max(before, 0) + size : between + 1] = np.moveaxis(a, axis, 0)
        end = len(rows) + min(behind, 0)
        a = np.moveaxis(rows[-min(before, 0) : end], 0, axis)
    return a


def _concatenate(*arrays: Array, dimension: int, **_: object) -> Array:
    return np.concatenate(arrays, axis=dimension)


MOVES: dict[str, Callable[..., Array]] = {
    "broadcast_in_dim": _broadcast,
    "reshape": lambda a, *, new_sizes, **_: a.reshape(new_sizes),
    "squeeze": lambda a, *, dimensions, **_: np.squeeze(a, axis=tuple(dimensions)),
    "expand_dims": lambda a, *, dimensions, **_: np.expand_dims(a, tuple(dimensions)),
    "transpose": lambda a, *, permutation, **_: np.transpose(a, permutation),
    "slice": _slice,
    "concatenate": _concatenate,
    "pad": _pad,
    "stack": lambda *arrays, axis=0, **_: np.stack(arrays, axis=axis),
    "rev": lambda a, *, dimensions, **_: np.flip(a, tuple(dimensions)),
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
        count = math.prod(array.shape[axis] for axis in first)
        return moved.reshape(count, math.prod(sizes), -1), sizes

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
