"""Host moves: how a host program moves entries, and reads and writes at places that a run tells."""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxbiped.compiler.host_code._arrays import gather
from jaxbiped.compiler.host_code._host_writer import (
    HostWriter,
    Operation,
    Rule,
    UnwrittenError,
    Value,
    listed,
)
from jaxbiped.compiler.ir._primitives import iota


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
    backwards = any(isinstance(p, slice) and (p.step or 1) < 0 for p in places)
    if value.part is not None and not backwards:
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


def _broadcast(w: HostWriter, op: Operation) -> list[Value]:
    if len(op.inputs) > 1:
        raise UnwrittenError("a shape known only in the run")
    shape, _ = op.result()
    axes = op.params["broadcast_dimensions"]
    value = op.inputs[0]
    if value.held == ():
        return [single_number(value, shape)]
    value = w.full(value)
    held = [1] * len(shape)
    for axis, n in zip(axes, value.shape, strict=True):
        held[axis] = n
    wide = reshaped(w, value, tuple(held))
    return [dataclasses.replace(wide, shape=shape, part=None)]


def _reshape(w: HostWriter, op: Operation) -> list[Value]:
    if op.params.get("dimensions") is not None or len(op.inputs) > 1:
        raise UnwrittenError("a reshape in another order")
    return [reshaped(w, op.inputs[0], op.result()[0])]


def _slice(w: HostWriter, op: Operation) -> list[Value]:
    p, value = op.params, op.inputs[0]
    steps = p["strides"] or [1] * len(value.shape)
    bounds = zip(p["start_indices"], p["limit_indices"], steps, value.shape, strict=True)
    parts = [
        slice(None) if (a, b, step) == (0, n, 1) else slice(int(a), int(b), int(step))
        for a, b, step, n in bounds
    ]
    if all(part == slice(None) for part in parts):
        return [value]
    return [part_of(w, value, parts, op.result()[0])]


def _along(
    w: HostWriter, op: Operation, axes: Sequence[int], parts: Sequence[slice | int]
) -> list[Value | None]:
    """Parts of an array along some axes, for the results that are needed."""
    value = op.inputs[0]
    return [
        part_of(
            w,
            value,
            [part if i in axes else slice(None) for i in range(len(value.shape))],
            op.result(k)[0],
        )
        if op.needs[k]
        else None
        for k, part in enumerate(parts)
    ]


def _split(w: HostWriter, op: Operation) -> list[Value | None]:
    ends = [0, *itertools.accumulate(map(int, op.params["sizes"]))]
    return _along(w, op, [op.params["axis"]], [slice(*each) for each in itertools.pairwise(ends)])


def _stack(w: HostWriter, op: Operation) -> list[Value]:
    axis, names = op.params["axis"], listed(len(op.inputs))
    return w.emit_whole(f"stack(({names},), {axis})" if axis else f"array(({names},))", op)


def _concatenate(w: HostWriter, op: Operation) -> list[Value]:
    shape, dtype = op.result()
    axis = op.params["dimension"]
    given = [each for each in op.inputs if each.shape[axis]]
    if not given:
        return [w.constant(np.zeros(shape, dtype))]
    pieces: list[Value] = []

    def single(value: Value) -> object:
        return value.shape == (1,) and value.held == () and (id(value.block), True)

    # Single numbers one behind the other are one array, those known before a loop another one.
    for key, group in itertools.groupby(given, single):
        run = list(group)
        if not key:
            pieces += [w.full(each) for each in run]
            continue
        pieces.append(w.emit(f"array(({listed(len(run))},))", run, (len(run),), dtype))
    if len(pieces) == 1:
        return pieces
    return [w.emit(f"concatenate(({listed(len(pieces))}), {axis})", pieces, shape, dtype)]


def _pad(w: HostWriter, op: Operation) -> list[Value]:
    config = tuple(tuple(map(int, each)) for each in op.params["padding_config"])
    if not any(itertools.chain(*config)):
        return [op.inputs[0]]
    return w.emit_whole(f"padded({{0}}, {{1}}, {config!r})", op)


def _dynamic_slice(w: HostWriter, op: Operation) -> list[Value]:
    shape, _ = op.result()
    sizes = tuple(map(int, op.params["slice_sizes"]))
    if all(each.constant is not None for each in op.inputs[1:]):
        starts = [
            min(max(int(start.constant), 0), n - size)
            for start, n, size in zip(op.inputs[1:], op.inputs[0].shape, sizes, strict=True)
        ]
        parts = [slice(a, a + size) for a, size in zip(starts, sizes, strict=True)]
        return [
            op.inputs[0] if shape == op.inputs[0].shape else part_of(w, op.inputs[0], parts, shape)
        ]
    return w.emit_whole(f"dynamic_slice({{0}}, {sizes!r}, {listed(len(sizes), 1)})", op)


def _gather(w: HostWriter, op: Operation) -> list[Value]:
    shape, dtype = op.result()
    p = op.params
    operand, indices = (w.full(each) for each in op.inputs)
    fill, numbers = _fill_value(p), p["dimension_numbers"]
    sizes = tuple(map(int, p["slice_sizes"]))
    if indices.constant is not None and operand.constant is None:
        # Of the entries' numbers instead of the entries it tells where each is.
        count = int(np.prod(operand.shape))
        entries = np.arange(1, 1 + count).reshape(operand.shape)
        beyond = None if fill is None else 0
        numbered = np.asarray(gather(entries, np.asarray(indices.constant), numbers, sizes, beyond))
        if np.all(numbered):
            places = w.constant(numbered - 1)
            return [w.emit("{0}.take({1})", [operand, places], shape, dtype)]
    axis = _whole_rows(operand.shape, numbers, sizes)
    if axis is not None and fill is None:
        return w.emit_whole(f"{{0}}.take({{1}}[..., 0], {axis}, mode='clip')", op)
    form = f"gather({{0}}, {{1}}, {w.thing(numbers)}, {sizes!r}, {w.thing(fill)})"
    return w.emit_whole(form, op)


def _fill_value(params: dict[str, Any]) -> Any:
    """What stands for entries beyond the end; None where the nearest do."""
    mode = params["mode"].name
    if mode in ("CLIP", "PROMISE_IN_BOUNDS"):
        return None
    if mode != "FILL_OR_DROP":
        raise UnwrittenError(f"a gather that may {mode}")
    return params["fill_value"]


def _whole_rows(shape: tuple[int, ...], numbers: Any, sizes: tuple[int, ...]) -> int | None:
    """The axis along which whole rows are taken, in their order; None where it is otherwise."""
    if len(numbers.start_index_map) != 1 or numbers.operand_batching_dims:
        return None
    (axis,) = numbers.start_index_map
    others = tuple(i for i in range(len(shape)) if i != axis)
    before, after = others[:axis], len(others) - axis
    whole = numbers.collapsed_slice_dims == (axis,) and all(sizes[i] == shape[i] for i in others)
    offsets = numbers.offset_dims
    inner = (
        offsets[axis:] == tuple(range(offsets[-1] + 1 - after, offsets[-1] + 1)) if after else True
    )
    return axis if whole and offsets[:axis] == before and inner else None


def _scatter_rule(adds: bool) -> Rule:
    def rule(w: HostWriter, op: Operation) -> list[Value]:
        p = op.params
        mode = p["mode"].name
        if mode not in ("CLIP", "FILL_OR_DROP", "PROMISE_IN_BOUNDS"):
            raise UnwrittenError(f"a scatter that may {mode}")
        numbers = p["dimension_numbers"]
        axes = tuple(range(len(op.result()[0])))
        one = numbers.inserted_window_dims == axes == numbers.scatter_dims_to_operand_dims
        if one and op.inputs[1].shape == (len(axes),) and not adds and mode != "CLIP":
            return w.emit_whole("replaced({0}, {1}, {2})", op)
        options = f"clips={mode == 'CLIP'}, adds={adds}"
        return w.emit_whole(f"scatter({listed(3)}, {w.thing(numbers)}, {options})", op)

    return rule


MOVES: dict[str, Rule] = {
    "broadcast_in_dim": _broadcast,
    "reshape": _reshape,
    "expand_dims": _reshape,
    "slice": _slice,
    "squeeze": lambda w, op: _along(w, op, op.params["dimensions"], [0]),
    "transpose": lambda w, op: [transposed(w, op.inputs[0], op.params["permutation"])],
    "rev": lambda w, op: _along(w, op, op.params["dimensions"], [slice(None, None, -1)]),
    "unstack": lambda w, op: _along(w, op, [op.params["axis"]], range(len(op.needs))),
    "split": _split,
    "stack": _stack,
    "concatenate": _concatenate,
    "iota": lambda w, op: [w.constant(iota(**op.params))],
    "pad": _pad,
    "dynamic_slice": _dynamic_slice,
    "gather": _gather,
    "scatter": _scatter_rule(adds=False),
    "scatter-add": _scatter_rule(adds=True),
}
