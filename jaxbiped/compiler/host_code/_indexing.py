"""Indexing: how a host program writes reading and writing at places that the run may tell."""

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
from jaxbiped.compiler.host_code._moves import part_of


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
    fill, numbers = _fill_value(p, dtype), p["dimension_numbers"]
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


def _fill_value(params: dict[str, Any], dtype: np.dtype) -> Any:
    """What stands for entries beyond the end; None where the nearest do."""
    mode, fill = params["mode"].name, params["fill_value"]
    if mode in ("CLIP", "PROMISE_IN_BOUNDS"):
        return None
    if mode != "FILL_OR_DROP":
        raise UnwrittenError(f"a gather that may {mode}")
    if fill is not None:
        return fill
    if np.issubdtype(dtype, np.inexact):
        return np.nan
    return True if dtype.kind == "b" else np.iinfo(dtype).min


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


INDEXING: dict[str, Rule] = {
    "dynamic_slice": _dynamic_slice,
    "gather": _gather,
    "scatter": _scatter_rule(adds=False),
    "scatter-add": _scatter_rule(adds=True),
}
