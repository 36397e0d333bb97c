"""Linear algebra: how a host program writes products and what LAPACK does."""

from collections.abc import Sequence

import numpy as np

from jaxbiped.compiler.host_code._host_writer import (
    HostWriter,
    Operation,
    Rule,
    UnwrittenError,
    Value,
)
from jaxbiped.compiler.host_code._views import transposed


def _product(w: HostWriter, op: Operation) -> list[Value]:
    shape, dtype = op.result()
    (left, right), (left_batch, right_batch) = op.params["dimension_numbers"]
    a, b = (w.full(each) for each in op.inputs)
    if len(left) != 1:
        raise UnwrittenError("a product over other than one axis")
    order_a = [*left_batch, *_others(a, [*left_batch, *left]), *left]
    order_b = [*right_batch, *right, *_others(b, [*right_batch, *right])]
    a, b = transposed(w, a, order_a), transposed(w, b, order_b)
    n = len(left_batch)
    if not n and len(b.shape) <= 2:
        return [w.emit("({0} @ {1})", [a, b], shape, dtype)]
    if len(a.shape) > n + 2 or len(b.shape) > n + 2:
        raise UnwrittenError("a product of many axes")
    rows = "" if len(a.shape) == n + 2 else "[..., None, :]"
    columns = "" if len(b.shape) == n + 2 else "[..., None]"
    form = f"({{0}}{rows} @ {{1}}{columns}).reshape({shape!r})"
    return [w.emit(form, [a, b], shape, dtype)]


def _others(value: Value, axes: Sequence[int]) -> list[int]:
    return [i for i in range(len(value.shape)) if i not in axes]


def _factors(w: HostWriter, op: Operation) -> Sequence[Value]:
    matrix = _square_matrix(w, op.inputs[0])
    return w.emit_all("factors_of({0})", [matrix], op.results())


def _triangular(w: HostWriter, op: Operation) -> list[Value]:
    shape, dtype = op.result()
    p = op.params
    a, b = _square_matrix(w, op.inputs[0]), w.full(op.inputs[1])
    how = dict(left=p["left_side"], lower=p["lower"], transposed=p["transpose_a"])
    options = ", ".join(f"{k}={bool(v)}" for k, v in (how | {"unit": p["unit_diagonal"]}).items())
    return [w.emit(f"triangular({{0}}, {{1}}, {options})", [a, b], shape, dtype)]


def _eigensystem(w: HostWriter, op: Operation) -> Sequence[Value]:
    sides = (op.params[f"compute_{side}_eigenvectors"] for side in ("left", "right"))
    left, right = map(bool, sides)
    matrix = _square_matrix(w, op.inputs[0])
    only = "" if left or right else "[0]"
    form = f"eigensystem_of({{0}}, left={left}, right={right}){only}"
    return w.emit_all(form, [matrix], op.results())


def _square_matrix(w: HostWriter, value: Value) -> Value:
    if len(value.shape) != 2 or value.dtype != np.float64:
        raise UnwrittenError("linear algebra of other than one matrix of 64-bit numbers")
    return w.full(value)


LINEAR_ALGEBRA: dict[str, Rule] = {
    "dot_general": _product,
    "lu": _factors,
    "triangular_solve": _triangular,
    "eig": _eigensystem,
}
