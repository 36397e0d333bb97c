"""Views: parts and other shapes of arrays in a host program, which move no entry."""

import dataclasses
from collections.abc import Sequence

from jaxbiped.compiler.host_code._host_writer import HostWriter, Value


def single_number(value: Value, shape: tuple[int, ...]) -> Value:
    """One number in the place of an array of it."""
    return dataclasses.replace(value, shape=shape, part=None)


def reshaped(w: HostWriter, value: Value, shape: tuple[int, ...]) -> Value:
    """The same entries in another shape."""
    if value.shape == shape:
        return value
    if value.held == ():
        return single_number(value, shape)
    if shape == ():
        return part_of(w, value, (0,) * len(value.shape), ())
    kept = [i for i, n in enumerate(value.shape) if n != 1]
    if value.part is not None and [value.shape[i] for i in kept] == list(shape):
        # An entry of an array, rather than an array of one entry of it.
        drops = tuple(slice(None) if i in kept else 0 for i in range(len(value.shape)))
        return part_of(w, value, drops, shape)
    return w.emit(f"{{0}}.reshape({shape!r})", [w.full(value)], shape, value.dtype)


def transposed(w: HostWriter, value: Value, order: Sequence[int]) -> Value:
    """With its axes in another order."""
    order = tuple(int(i) for i in order)
    if order == tuple(range(len(order))):
        return value
    shape = tuple(value.shape[i] for i in order)
    if value.held == ():
        return single_number(value, shape)
    form = "{0}.T" if order == (1, 0) else f"{{0}}.transpose({order!r})"
    return w.emit(form, [w.full(value)], shape, value.dtype)


def part_of(
    w: HostWriter, value: Value, indices: Sequence[slice | int], shape: tuple[int, ...]
) -> Value:
    """A part of an array, taken of the array of which that is one itself."""
    if value.held == ():
        return single_number(value, shape)
    base, places = w.full(value), list(indices)
    if value.part is not None:
        base, outer = value.part
        left = iter(places)
        places = [each if isinstance(each, int) else _within(each, next(left)) for each in outer]
    text = ", ".join(str(p) if isinstance(p, int) else _colon(p) for p in places)
    found = w.later(f"{{0}}[{text}]", base, shape)
    if all(isinstance(p, int) or p.step in (None, 1) for p in places):
        found.part = base, tuple(places)
    return found


def _within(outer: slice, inner: slice | int) -> slice | int:
    begin = outer.start or 0
    if isinstance(inner, int):
        return begin + inner
    if inner == slice(None):
        return outer
    end = outer.stop if inner.stop is None else begin + inner.stop
    return slice(begin + (inner.start or 0), end, inner.step)


def _colon(part: slice) -> str:
    begin, end = ("" if x is None else str(x) for x in (part.start, part.stop))
    return f"{begin}:{end}" + ("" if part.step in (None, 1) else f":{part.step}")
