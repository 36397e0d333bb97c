"""Host operations: how a host program writes operations of JAX, calls, branches and loops."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxbiped._jax_versions import CALLS, called_program, scan_counts
from jaxbiped.compiler.host_code._host_writer import (
    Block,
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
    if len(cases) > 2:
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


def _parts(program: Any) -> tuple[Any, Sequence[Any]]:
    """A program's operations and its constants."""
    return getattr(program, "jaxpr", program), getattr(program, "consts", ())


def _call(w: HostWriter, op: Operation) -> list[Any]:
    called = called_program(op.equation)
    assert called is not None
    return w.inline(*called, op.inputs, op.needs)


def _linear_solve(w: HostWriter, op: Operation) -> list[Any]:
    counts, programs = op.params["const_lengths"], op.params["jaxprs"]
    before = counts.matvec + counts.vecmat
    own = op.inputs[before : before + counts.solve]
    rest = op.inputs[before + counts.solve + counts.transpose_solve :]
    return w.inline(*_parts(programs.solve), [*own, *rest], op.needs)


def _platform(w: HostWriter, op: Operation) -> list[Value]:
    kinds = op.params["platforms"]
    here = [k for k, kind in enumerate(kinds) if kind is None or "cpu" in kind]
    return [w.constant(here[0], op.result()[1])]


def _branches(w: HostWriter, op: Operation) -> list[Any]:
    which, *operands = op.inputs
    programs = op.params["branches"]
    if which.constant is not None:
        chosen = programs[min(max(int(which.constant), 0), len(programs) - 1)]
        return w.inline(*_parts(chosen), operands, op.needs)
    results: list[Value | None] = [
        Value(w.block, shape, dtype, shape, w.fresh()) if wanted else None
        for (shape, dtype, _), wanted in zip(op.results(), op.needs, strict=True)
    ]
    asked, last = w.text(which), len(programs) - 1
    # All are written before the first line: what they need of what is outside goes before that.
    insides = [_branch(w, program, operands, results) for program in programs]
    for number, inside in reversed(list(enumerate(insides))):
        how = "if" if number == last else "else" if number == 0 else "elif"
        sense = "" if number == 0 else f" {asked} {'>=' if number == last else '=='} {number}"
        w.block.lines.append(f"{how}{sense}:")
        _close(w.block, inside)
    return results


def _branch(
    w: HostWriter, program: Any, operands: list[Value], results: list[Value | None]
) -> Block:
    """One branch; its results get the names of the conditional's."""
    inside = Block(w.block, branch=True)
    needs = [each is not None for each in results]

    def write() -> list[tuple[str | None, str]]:
        found = w.inline(*_parts(program), operands, needs)
        pairs = [(r, w.full(f)) for r, f in zip(results, found, strict=True) if r and f]
        return [(r.name, w.text(f)) for r, f in pairs]

    _assign(inside, w.inside(inside, write))
    return inside


def _assign(block: Block, pairs: Sequence[tuple[str | None, str]]) -> None:
    """All at once: what is assigned may be what another one was."""
    pairs = [pair for pair in pairs if pair[0] != pair[1]]
    if pairs:
        names, texts = zip(*pairs, strict=True)
        block.lines.append(f"{', '.join(map(str, names))} = {', '.join(texts)}")


def _close(outer: Block, inside: Block) -> None:
    outer.lines += ["    " + line for line in inside.lines or ["pass"]]


def _held(w: HostWriter, block: Block, like: Sequence[Value]) -> list[Value]:
    """What a loop carries, of these at first."""
    return [Value(block, v.shape, v.dtype, v.shape, w.fresh()) for v in like]


def _while(w: HostWriter, op: Operation) -> list[Value]:
    p = op.params
    a, b = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
    starts = [w.full(each) for each in op.inputs[b:]]
    inside = Block(w.block)
    held = _held(w, inside, starts)
    _carry_on(w, held, starts)

    def write() -> None:
        (goes_on,) = w.inline(*_parts(p["cond_jaxpr"]), [*op.inputs[:a], *held])
        assert goes_on is not None
        inside.lines.append(f"if not {w.text(goes_on)}: break")
        found = _turn(w, p["body_jaxpr"], [*op.inputs[a:b], *held])
        _carry_on(w, held, found)

    w.inside(inside, write)
    w.block.lines.append("while True:")
    _close(w.block, inside)
    return [Value(w.block, h.shape, h.dtype, h.held, h.name) for h in held]


def _turn(w: HostWriter, program: Any, inputs: list[Value]) -> list[Value]:
    """What one turn of a loop gives."""
    return [w.full(each) for each in w.inline(*_parts(program), inputs) if each is not None]


def _carry_on(w: HostWriter, held: list[Value], found: list[Value]) -> None:
    """The next turn's values in place of this one's."""
    _assign(w.block, [(h.name, w.text(f)) for h, f in zip(held, found, strict=True)])


def _scan(w: HostWriter, op: Operation) -> list[Value]:
    p = op.params
    length = p["length"]
    a, carried = scan_counts(p)
    b = a + carried
    if not length:
        raise UnwrittenError("a scan of no turns")
    items = [w.full(each) for each in op.inputs[b:]]
    starts = [w.full(each) for each in op.inputs[a:b]]
    inside = Block(w.block)
    held, turn = _held(w, inside, starts), w.fresh("i")
    place = Value(inside, (), int, (), turn)
    lists = [w.fresh("l") for _ in op.equation.outvars[b - a :]]
    _carry_on(w, held, starts)

    def write() -> list[Value]:
        parts = [w.emit("{0}[{1}]", [v, place], v.shape[1:], v.dtype) for v in items]
        found = _turn(w, p["jaxpr"], [*op.inputs[:a], *held, *parts])
        rows = found[len(held) :]
        texts = [w.text(row) for row in rows]
        inside.lines.extend(f"{n}.append({t})" for n, t in zip(lists, texts, strict=True))
        _carry_on(w, held, found[: len(held)])
        return rows

    rows = w.inside(inside, write)
    order = f"range({length - 1}, -1, -1)" if p["reverse"] else f"range({length})"
    w.block.lines += [*(f"{name} = []" for name in lists), f"for {turn} in {order}:"]
    _close(w.block, inside)
    ends = [Value(w.block, h.shape, h.dtype, h.held, h.name) for h in held]
    return [*ends, *(_listed(w, n, r, p) for n, r in zip(lists, rows, strict=True))]


def _listed(w: HostWriter, name: str, row: Value, params: dict[str, Any]) -> Value:
    """The rows of a scan, one behind the other."""
    shape = (params["length"], *row.shape)
    turned = "[::-1]" if params["reverse"] else ""
    whole = Value(w.block, shape, row.dtype, shape, w.fresh())
    w.block.lines.append(f"{whole.name} = array({name}){turned}")
    return whole


CONTROL_FLOW: dict[str, Rule] = dict.fromkeys(CALLS, _call) | {
    "custom_vmap_call": lambda w, op: w.inline(*_parts(op.params["call"]), op.inputs, op.needs),
    "custom_linear_solve": _linear_solve,
    "platform_index": _platform,
    "cond": _branches,
    "while": _while,
    "scan": _scan,
}
