"""Primitives of JAX as operations of a graph, elementwise ones and those of small arrays."""

import enum
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from jaxbiped.compiler.ir import _elementary_functions as elementary
from jaxbiped.compiler.ir import _elementary_functions as powers
from jaxbiped.compiler.ir._graph import Block, Kind, Value

Array: TypeAlias = np.ndarray
"""An array of values, dtype object."""
Rule: TypeAlias = Callable[..., Value]

KINDS = {
    np.dtype("float64"): Kind.F64,
    np.dtype("float32"): Kind.F32,
    np.dtype("int64"): Kind.I64,
    np.dtype("int32"): Kind.I32,
    np.dtype("bool"): Kind.BOOL,
}


def array_of(values: Sequence[Value], shape: tuple[int, ...]) -> Array:
    """Values in row-major order as an array."""
    array = np.empty(len(values), dtype=object)
    array[:] = list(values)
    return array.reshape(shape)


def elementwise(function: Callable[..., Value], *arrays: Array) -> Array:
    """Applies a function of values to arrays."""
    if all(array.ndim == 0 for array in arrays):
        return array_of([function(*(array[()] for array in arrays))], ())
    result = np.frompyfunc(function, len(arrays), 1)(*arrays)
    return result if isinstance(result, np.ndarray) else array_of([result], ())


# Elementwise rules: (block, *values, **parameters of the primitive) -> value.


def _operation(of_floats: str, of_others: str | None = None) -> Rule:
    """One operation of the graph, by another name for whole numbers and truth values."""
    others = of_floats if of_others is None else of_others
    return lambda block, a, *rest, **_: block.add(
        of_floats if a.kind.is_float else others, a, *rest
    )


def _comparison(float_name: str, int_name: str) -> Rule:
    def rule(block: Block, a: Value, b: Value, **_: object) -> Value:
        if a.kind is Kind.BOOL:
            different = block.add("xor", a, b)
            return different if int_name == "ne" else block.add("not", different)
        op = f"fcmp {float_name}" if a.kind.is_float else f"icmp {int_name}"
        return block.add(op, a, b, kind=Kind.BOOL)

    return rule


def _extreme(float_how: str, int_how: str) -> Rule:
    """Of two; NaN where either is."""

    def rule(block: Block, a: Value, b: Value, **_: object) -> Value:
        if a.kind is Kind.BOOL:
            return block.add("or" if int_how == "sgt" else "and", a, b)
        if not a.kind.is_float:
            better = block.add(f"icmp {int_how}", a, b, kind=Kind.BOOL)
            return block.add("select", better, a, b, kind=a.kind)
        if b.constant is not None and b.constant == 0.0:
            # Unordered, for zeros of both signs are equal: a NaN in `a` wins.
            better = block.add(f"fcmp u{float_how}", a, b, kind=Kind.BOOL)
            return block.add("select", better, a, b, kind=a.kind)
        if b.constant is not None and b.constant == b.constant:
            a, b = b, a
        # In this order one instruction of CPUs, for which a NaN in `b` wins.
        better = block.add(f"fcmp o{float_how}", a, b, kind=Kind.BOOL)
        chosen = block.add("select", better, a, b, kind=a.kind)
        if a.constant is not None and a.constant == a.constant:
            return chosen
        missing = block.add("fcmp uno", a, a, kind=Kind.BOOL)
        return block.add("select", missing, a, chosen, kind=a.kind)

    return rule


def _negative(block: Block, a: Value, **_: object) -> Value:
    if a.kind.is_float:
        return block.add("fneg", a)
    return block.add("sub", block.const(0, a.kind), a)


def _size(block: Block, a: Value, **_: object) -> Value:
    if a.kind.is_float:
        return block.add("fabs", a)
    below = block.add("icmp slt", a, block.const(0, a.kind), kind=Kind.BOOL)
    return block.add("select", below, _negative(block, a), a, kind=a.kind)


def _sign(block: Block, a: Value, **_: object) -> Value:
    if not a.kind.is_float:
        raise NotImplementedError
    zero = block.const(0.0, a.kind)
    up = block.add("fcmp ogt", a, zero, kind=Kind.BOOL)
    down = block.add("fcmp olt", a, zero, kind=Kind.BOOL)
    negative = block.add("select", down, block.const(-1.0, a.kind), a, kind=a.kind)
    return block.add("select", up, block.const(1.0, a.kind), negative, kind=a.kind)


def _round(block: Block, a: Value, *, rounding_method: enum.IntEnum, **_: object) -> Value:
    if int(rounding_method) != 1:  # to the nearest, ties to even
        raise NotImplementedError
    return block.add("rint", a)


def _invert(block: Block, a: Value, **_: object) -> Value:
    if a.kind is Kind.BOOL:
        return block.add("not", a)
    return block.add("xor", a, block.const(-1, a.kind))


def _is_finite(block: Block, a: Value, **_: object) -> Value:
    size = block.add("fabs", a)
    return block.add("fcmp olt", size, block.const(math.inf, a.kind), kind=Kind.BOOL)


def _whole_power(block: Block, a: Value, *, y: int, **_: object) -> Value:
    multiply = functools.partial(ELEMENTWISE["mul"], block)
    divide = functools.partial(block.add, "fdiv")
    return powers.whole_power(a, y, multiply, divide, lambda a: block.const(1, a.kind))


def convert(block: Block, a: Value, kind: Kind) -> Value:
    """A value as another kind of number."""
    if a.kind is kind:
        return a
    if a.constant is not None:
        return block.const(a.constant, kind)
    if kind is Kind.BOOL:
        op = "fcmp une" if a.kind.is_float else "icmp ne"
        return block.add(op, a, block.const(0, a.kind), kind=kind)
    if a.kind is Kind.BOOL:
        return block.add("select", a, block.const(1, kind), block.const(0, kind), kind=kind)
    if a.kind.is_float and kind.is_float:
        return block.add("resize_float", a, kind=kind)
    if a.kind.is_float:
        return block.add("to_int", a, kind=kind)
    return block.add("to_float" if kind.is_float else "resize_int", a, kind=kind)


def match_kinds(block: Block, arrays: Sequence[Array], like: Sequence[Array]) -> list[Array]:
    """The same values, each as the kind of another one."""
    pairs = zip(arrays, like, strict=True)
    return [elementwise(lambda v, w: convert(block, v, w.kind), *pair) for pair in pairs]


def _divide(block: Block, a: Value, b: Value, **_: object) -> Value:
    """By the reciprocal, which other divisions by the same number share."""
    if not a.kind.is_float:
        raise NotImplementedError
    if b.constant is not None or a.constant is not None:
        return block.add("fdiv", a, b)
    return block.add("fmul", a, block.add("fdiv", block.const(1.0, a.kind), b))


def _convert(block: Block, a: Value, *, new_dtype: npt.DTypeLike, **_: object) -> Value:
    return convert(block, a, KINDS[np.dtype(new_dtype)])


def _select(block: Block, which: Value, *cases: Value, **_: object) -> Value:
    if len(cases) != 2:
        raise NotImplementedError
    chosen = convert(block, which, Kind.BOOL)
    return block.add("select", chosen, cases[1], cases[0], kind=cases[0].kind)


def _clamp(block: Block, low: Value, a: Value, high: Value, **_: object) -> Value:
    above = ELEMENTWISE["max"](block, a, low)
    return ELEMENTWISE["min"](block, above, high)


def _elementary(function: Callable[..., Value]) -> Rule:
    def rule(block: Block, *args: Value, **_: object) -> Value:
        kind = args[0].kind
        wide = [convert(block, a, Kind.F64) for a in args]

        def make(home: Block) -> Value:
            return function(elementary.Arithmetic(home), *wide)

        return convert(
            block, block.shared(function.__qualname__ + str(id(function)), wide, make), kind
        )

    return rule


def _logarithm(block: Block, a: Value, **_: object) -> Value:
    found: Value = _elementary(elementary.logarithm)(block, a)
    if a.kind is Kind.F64 and found.constant is None:
        found.logarithm_of = a
    return found


def _binary_logarithm(block: Block, a: Value, **_: object) -> Value:
    """A quotient, so that it is exact for powers of two."""
    return block.add("fdiv", _logarithm(block, a), block.const(math.log(2.0), a.kind))


def _polynomial(block: Block, x: Value, *coefficients: Value, **_: object) -> Value:
    """Of a variable by its coefficients, the constant one first."""
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = ELEMENTWISE["add"](block, ELEMENTWISE["mul"](block, total, x), coefficient)
    return total


def _one_minus_square(block: Block, a: Value, **_: object) -> Value:
    """1 − a² as (1 − a)(1 + a), which keeps its digits where a is close to 1."""
    one = block.const(1.0, a.kind)
    return block.add("fmul", block.add("fsub", one, a), block.add("fadd", one, a))


def _exponential(block: Block, a: Value, **_: object) -> Value:
    """Of y log x it is a power, and of that three halves are the usual ones: Hertz's."""
    if a.op == "fmul":
        for y, logarithm in (a.args, a.args[::-1]):
            if logarithm.logarithm_of is not None:
                return _elementary(powers.power_of_root)(block, logarithm.logarithm_of, y)
    return _elementary(elementary.exponential)(block, a)


_PASSED_ON = ("stop_gradient", "copy", "copy_p", "optimization_barrier", "reduce_precision")
_OVER_LANES = ("unvmap_any", "unvmap_all", "unvmap_max")
"""Conditions over all lanes of a batch: here each is one over this lane."""


ELEMENTWISE: dict[str, Rule] = {
    "add": _operation("fadd", "add"),
    "add_any": _operation("fadd", "add"),
    "sub": _operation("fsub", "sub"),
    "mul": _operation("fmul", "mul"),
    "div": _divide,
    "neg": _negative,
    "abs": _size,
    "sign": _sign,
    "max": _extreme("gt", "sgt"),
    "min": _extreme("lt", "slt"),
    "sqrt": _operation("sqrt"),
    "round": _round,
    "floor": _operation("floor"),
    "ceil": _operation("ceil"),
    "exp": _exponential,
    "log": _logarithm,
    "log2": _binary_logarithm,
    "one_minus_square": _one_minus_square,
    "polynomial": _polynomial,
    "sin": _elementary(elementary.sine),
    "cos": _elementary(elementary.cosine),
    "tanh": _elementary(elementary.hyperbolic_tangent),
    "pow": _elementary(powers.power),
    "integer_pow": _whole_power,
    "square": lambda block, a, **_: ELEMENTWISE["mul"](block, a, a),
    "eq": _comparison("oeq", "eq"),
    "ne": _comparison("une", "ne"),
    "lt": _comparison("olt", "slt"),
    "le": _comparison("ole", "sle"),
    "gt": _comparison("ogt", "sgt"),
    "ge": _comparison("oge", "sge"),
    "and": _operation("and"),
    "or": _operation("or"),
    "xor": _operation("xor"),
    "not": _invert,
    "is_finite": _is_finite,
    "select_n": _select,
    "clamp": _clamp,
    "convert_element_type": _convert,
    **dict.fromkeys((*_PASSED_ON, *_OVER_LANES), lambda block, a, **_: a),
}


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

    def summed(row: Array, column: Array) -> Value:
        terms = [multiply(x, y) for x, y in zip(row, column, strict=True)]
        # A sum of no terms: of directions of which there are none.
        return functools.reduce(add, terms) if terms else block.const(0.0, Kind.F64)

    found = [
        summed(row, column)
        for rows, columns in zip(left, right, strict=True)
        for row in rows
        for column in columns
    ]
    batch = [a.shape[axis] for axis in a_batch]
    return array_of(found, (*batch, *left_sizes, *right_sizes))
