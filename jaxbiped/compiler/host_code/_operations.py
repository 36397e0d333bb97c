"""Host operations: how a host program writes operations of JAX, linear algebra among them."""

from collections.abc import Sequence

import numpy as np

from jaxbiped.compiler.host_code._host_writer import (
    HostWriter,
    Operation,
    Rule,
    UnwrittenError,
    Value,
    listed,
)
from jaxbiped.compiler.host_code._moves import reshaped

_ELEMENTARY = ("sqrt", "exp", "log", "log1p", "log2", "expm1")
_CIRCULAR = ("sin", "cos", "tan", "sinh", "cosh", "tanh")
_ROUNDING = ("abs", "sign", "floor", "ceil", "conj")
_ENTRYWISE = {name: f"{name}({{0}})" for name in (*_ELEMENTARY, *_CIRCULAR, *_ROUNDING)} | {
    "add": "({0} + {1})",
    "add_any": "({0} + {1})",
    "sub": "({0} - {1})",
    "mul": "({0} * {1})",
    "neg": "(-{0})",
    "max": "maximum({0}, {1})",
    "min": "minimum({0}, {1})",
    "pow": "({0} ** {1})",
    "square": "({0} * {0})",
    "rsqrt": "(1.0 / sqrt({0}))",
    "one_minus_square": "((1.0 - {0}) * (1.0 + {0}))",
    "asin": "arcsin({0})",
    "acos": "arccos({0})",
    "atan": "arctan({0})",
    "atan2": "arctan2({0}, {1})",
    "nextafter": "nextafter({0}, {1})",
    "eq": "({0} == {1})",
    "ne": "({0} != {1})",
    "lt": "({0} < {1})",
    "le": "({0} <= {1})",
    "gt": "({0} > {1})",
    "ge": "({0} >= {1})",
    "and": "({0} & {1})",
    "or": "({0} | {1})",
    "xor": "({0} ^ {1})",
    "not": "(~{0})",
    "is_finite": "isfinite({0})",
    "real": "({0}.real)",
    "imag": "({0}.imag)",
    "clamp": "minimum(maximum({1}, {0}), {2})",
}
_SAME = ("stop_gradient", "copy", "copy_p", "optimization_barrier")
_REDUCTIONS = {
    "reduce_sum": "add",
    "reduce_max": "maximum",
    "reduce_min": "minimum",
    "reduce_prod": "multiply",
    "reduce_and": "logical_and",
    "reduce_or": "logical_or",
}
_OF_NONE = {"maximum": -np.inf, "minimum": np.inf}
"""What reductions without an identity in NumPy give of no entries."""


def _entrywise(w: HostWriter, op: Operation, form: str, inputs: Sequence[Value]) -> Value:
    """An operation entry by entry, on no more entries than differ."""
    shape, dtype = op.result()
    held = np.broadcast_shapes(*(each.held for each in inputs))
    return w.emit(form, inputs, shape, dtype, held)


def _entrywise_rule(form: str) -> Rule:
    return lambda w, op: [_entrywise(w, op, form, op.inputs)]


def _divide(w: HostWriter, op: Operation) -> list[Value]:
    whole = np.issubdtype(op.inputs[0].dtype, np.integer)
    form = "divide_whole({0}, {1})" if whole else "({0} / {1})"
    return [_entrywise(w, op, form, op.inputs)]


def _convert(w: HostWriter, op: Operation) -> list[Value]:
    _, dtype = op.result()
    if dtype == op.inputs[0].dtype:
        return op.inputs
    form = "({0} != 0)" if dtype.kind == "b" else f"{{0}}.astype({dtype.name})"
    return [_entrywise(w, op, form, op.inputs)]


def _round(w: HostWriter, op: Operation) -> list[Value]:
    if int(op.params["rounding_method"]) != 1:  # to the nearest, ties to even
        raise UnwrittenError("rounding other than to even")
    return [_entrywise(w, op, "rint({0})", op.inputs)]


def _polynomial(w: HostWriter, op: Operation) -> list[Value]:
    """Horner's rule; the constant coefficient comes first."""
    form = f"{{{len(op.inputs) - 1}}}"
    for number in range(len(op.inputs) - 2, 0, -1):
        form = f"({form} * {{0}} + {{{number}}})"
    return [_entrywise(w, op, form, op.inputs)]


def _bits(w: HostWriter, op: Operation) -> list[Value]:
    _, dtype = op.result()
    if dtype.itemsize != np.dtype(op.inputs[0].dtype).itemsize:
        raise UnwrittenError("bits of types of different sizes")
    return [_entrywise(w, op, f"{{0}}.view({dtype.name})", op.inputs)]


def _select(w: HostWriter, op: Operation) -> list[Value]:
    which, *cases = op.inputs
    if len(cases) == 1:
        return cases
    if len(cases) > 2 or which.dtype.kind != "b":
        raise UnwrittenError("a choice among several")
    if which.constant is not None and which.held == ():
        return [cases[int(which.constant)]]
    if which.held == ():
        shape, dtype = op.result()
        if cases[0].held != cases[1].held:
            cases = [w.full(each) for each in cases]
        form = "({2} if {0} else {1})"
        return [w.emit(form, [which, *cases], shape, dtype, cases[0].held)]
    return [_entrywise(w, op, "where({0}, {2}, {1})", op.inputs)]


def _reduce_rule(name: str) -> Rule:
    def rule(w: HostWriter, op: Operation) -> list[Value]:
        shape, dtype = op.result()
        axes = tuple(int(axis) for axis in op.params["axes"])
        if all(op.inputs[0].shape[i] == 1 for i in axes):
            return [reshaped(w, op.inputs[0], shape)]
        if dtype.kind == "f" and name in _OF_NONE and 0 in op.inputs[0].shape:
            return [w.constant(np.full(shape, _OF_NONE[name], dtype))]
        axis = axes[0] if len(axes) == 1 else axes
        # Of small whole numbers NumPy would make larger ones.
        kept = f", {dtype.name}" if dtype.kind == "i" and name in ("add", "multiply") else ""
        if name.startswith("logical") and dtype.kind != "b":
            raise UnwrittenError("a reduction of bits")
        return w.emit_whole(f"{name}.reduce({{0}}, {axis}{kept})", op)

    return rule


def _place_rule(method: str) -> Rule:
    def rule(w: HostWriter, op: Operation) -> list[Value]:
        shape, dtype = op.result()
        (axis,) = op.params["axes"]
        if op.inputs[0].shape[axis] == 1:
            return [w.constant(np.zeros(shape, dtype))]
        return w.emit_whole(f"{{0}}.{method}({int(axis)}).astype({dtype.name})", op)

    return rule


def _sort(w: HostWriter, op: Operation) -> Sequence[Value]:
    axis, keys = op.params["dimension"], op.params["num_keys"]
    only = "[0]" if len(op.inputs) == 1 else ""
    form = f"sorted_by(({listed(len(op.inputs))},), {axis}, {keys}){only}"
    return w.emit_all(form, [w.full(each) for each in op.inputs], op.results())


OPERATIONS: dict[str, Rule] = (
    {name: _entrywise_rule(form) for name, form in _ENTRYWISE.items()}
    | dict.fromkeys(_SAME, lambda w, op: op.inputs)
    | {name: _reduce_rule(how) for name, how in _REDUCTIONS.items()}
    | {
        "div": _divide,
        "rem": _entrywise_rule("fmod({0}, {1})"),
        "convert_element_type": _convert,
        "round": _round,
        "integer_pow": lambda w, op: _entrywise_rule(f"power_of({{0}}, {op.params['y']})")(w, op),
        "polynomial": _polynomial,
        "bitcast_convert_type": _bits,
        "select_n": _select,
        "argmax": _place_rule("argmax"),
        "argmin": _place_rule("argmin"),
        "sort": _sort,
    }
)


def _product(w: HostWriter, op: Operation) -> list[Value]:
    """Sums in one order: BLAS rounds otherwise on each kind of processor, and steps may follow."""
    shape, dtype = op.result()
    summed, batch = op.params["dimension_numbers"]
    a, b = (w.full(each) for each in op.inputs)
    ours = [chr(97 + i) for i in range(len(a.shape))]
    theirs = [chr(65 + i) for i in range(len(b.shape))]
    for i, j in zip((*batch[0], *summed[0]), (*batch[1], *summed[1]), strict=True):
        theirs[j] = ours[i]
    kept = [ours[i] for i in batch[0]] + _others(ours, batch[0], summed[0])
    kept += _others(theirs, batch[1], summed[1])
    form = f"einsum('{''.join(ours)},{''.join(theirs)}->{''.join(kept)}', {{0}}, {{1}})"
    return [w.emit(form, [a, b], shape, dtype)]


def _others(letters: Sequence[str], *axes: Sequence[int]) -> list[str]:
    taken = [i for some in axes for i in some]
    return [letter for i, letter in enumerate(letters) if i not in taken]


def _triangular(w: HostWriter, op: Operation) -> list[Value]:
    p = op.params
    _square_matrix(w, op.inputs[0])
    how = dict(left=p["left_side"], lower=p["lower"], transposed=p["transpose_a"])
    options = ", ".join(f"{k}={bool(v)}" for k, v in (how | {"unit": p["unit_diagonal"]}).items())
    return w.emit_whole(f"triangular({{0}}, {{1}}, {options})", op)


def _eigensystem(w: HostWriter, op: Operation) -> Sequence[Value]:
    sides = (op.params[f"compute_{side}_eigenvectors"] for side in ("left", "right"))
    left, right = map(bool, sides)
    matrix = _square_matrix(w, op.inputs[0])
    only = "" if left or right else "[0]"
    form = f"eigensystem_of({{0}}, left={left}, right={right}){only}"
    return w.emit_all(form, [matrix], op.results())


def _singular_system(w: HostWriter, op: Operation) -> Sequence[Value]:
    p, value = op.params, op.inputs[0]
    if value.dtype != np.float64 or p["subset_by_index"] is not None:
        raise UnwrittenError("singular values of other than 64-bit numbers, or some of them")
    full, vectors = bool(p["full_matrices"]), bool(p["compute_uv"])
    only = "" if vectors else "[0]"
    form = f"singular_system_of({{0}}, full={full}, vectors={vectors}){only}"
    return w.emit_all(form, [w.full(value)], op.results())


def _square_matrix(w: HostWriter, value: Value) -> Value:
    if len(value.shape) != 2 or value.dtype != np.float64:
        raise UnwrittenError("linear algebra of other than one matrix of 64-bit numbers")
    return w.full(value)


LINEAR_ALGEBRA: dict[str, Rule] = {
    "dot_general": _product,
    "lu": lambda w, op: w.emit_all(
        "factors_of({0})", [_square_matrix(w, op.inputs[0])], op.results()
    ),
    "triangular_solve": _triangular,
    "eig": _eigensystem,
    "svd": _singular_system,
}
