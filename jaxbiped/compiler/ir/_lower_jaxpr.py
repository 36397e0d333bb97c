"""Lowering of a jaxpr of small static shapes to a graph of scalar operations.

Arrays disappear here: each entry becomes a value of its own, which a lane can keep in a register.
"""

import functools
import itertools
from collections.abc import Sequence
from typing import Any, TypeAlias

import jax
import numpy as np
import numpy.typing as npt
from jax.extend.core import Jaxpr, JaxprEqn, Literal, Var

from jaxbiped._checks import ArgumentError
from jaxbiped._jax_versions import ClosedJaxpr, called_program, scan_counts
from jaxbiped._types import Numbers
from jaxbiped.compiler.ir._graph import Block, Kind, Value
from jaxbiped.compiler.ir._primitives import (
    ELEMENTWISE,
    KINDS,
    MOVES,
    REDUCTIONS,
    Array,
    array_of,
    convert,
    elementwise,
    iota,
    match_kinds,
    product,
    reduce,
)
from jaxbiped.compiler.ir._vertex_elimination import (
    JACOBIAN,
    Arithmetic,
    NoRuleError,
    Weight,
    eliminated_rows,
    parted,
    pulled_back,
)

_LONGEST_UNROLLED, _LARGEST_UNROLLED = 4, 2000
"""Loops over arrays of up to this length are written out, and up to so many equations in all."""

Atom: TypeAlias = Var | Literal


class UnknownPrimitiveError(ArgumentError, NotImplementedError):
    """A JAX operation that the lane engine cannot express; the message names an engine that can."""


def lower_jaxpr(
    block: Block, jaxpr: Jaxpr, consts: Sequence[Numbers], args: Sequence[Array]
) -> list[Array]:
    """Adds a jaxpr's operations to a block; the arrays of its results.

    Raises:
        UnknownPrimitiveError: it holds an operation that lanes do not have.
    """
    known: dict[Var, Array] = {}
    for variable, const in zip(jaxpr.constvars, consts, strict=True):
        lowered = isinstance(const, np.ndarray) and const.dtype == object
        known[variable] = np.asarray(const) if lowered else _constant(block, const)
    known.update(zip(jaxpr.invars, args, strict=True))

    def read(atom: Atom) -> Array:
        return _literal(block, atom) if isinstance(atom, Literal) else known[atom]

    for equation in jaxpr.eqns:
        inputs = [read(atom) for atom in equation.invars]
        try:
            results = _apply(block, equation, inputs)
        except (NotImplementedError, KeyError) as error:
            if isinstance(error, UnknownPrimitiveError):
                raise
            raise UnknownPrimitiveError(
                f"the JAX primitive {equation.primitive.name!r} on "
                f"{[str(v.aval) for v in equation.invars]} has no form in the lane engine; "
                'use engine="xla".'
            ) from None
        known.update(zip(equation.outvars, results, strict=True))
    return [read(atom) for atom in jaxpr.outvars]


def _literal(block: Block, atom: Literal) -> Array:
    return _constant(block, np.asarray(atom.val, dtype=atom.aval.dtype))  # type: ignore[attr-defined]


def _constant(block: Block, value: npt.ArrayLike) -> Array:
    numbers = np.asarray(value)
    kind = KINDS[numbers.dtype]
    return array_of([block.const(x, kind) for x in numbers.ravel()], numbers.shape)


def _apply(block: Block, equation: JaxprEqn, inputs: list[Array]) -> list[Array]:
    name, params = equation.primitive.name, equation.params
    inner = called_program(equation)
    if inner is not None:
        called, consts = inner
        if consts:
            return lower_jaxpr(block, called, consts, inputs)
        # Operations are shared one by one, too, but conditionals and loops inside a call are not.
        key = called, *(id(v) for array in inputs for v in array.ravel())
        return block.call(key, lambda: lower_jaxpr(block, called, (), inputs))
    if name in ELEMENTWISE:
        rule = ELEMENTWISE[name]
        if name == "select_n" and inputs[0].ndim == 0 and inputs[1].ndim > 0:
            inputs = [np.broadcast_to(inputs[0], inputs[1].shape), *inputs[1:]]
        return [elementwise(lambda *values: rule(block, *values, **params), *inputs)]
    if name in MOVES:
        moved = MOVES[name](*inputs, **params)
        return moved if isinstance(moved, list) else [moved]
    if name in REDUCTIONS:
        return [reduce(block, name, inputs[0], params["axes"])]
    if name == "dot_general":
        return [product(block, *inputs, **params)]
    if name == "iota":
        return [_constant(block, iota(**params))]
    if name == "cond":
        return _branches(block, params["branches"], inputs)
    if name == "scan":
        return _scan(block, params, inputs)
    if equation.primitive is JACOBIAN:
        return _jacobian(block, inputs, **params)
    raise NotImplementedError


def _jacobian(block: Block, operands: list[Array], program: Jaxpr) -> list[Array]:
    consts, inputs = parted(program, operands)
    kind = inputs[0].item().kind
    try:
        rows = eliminated_rows(program, consts, inputs, _arithmetic(block, kind))
    except NoRuleError:
        shapes = [v.aval for v in (*program.constvars, *program.invars[: len(inputs)])]
        closed = jax.make_jaxpr(functools.partial(pulled_back, program=program))(*shapes)
        return lower_jaxpr(block, closed.jaxpr, closed.consts, operands)
    values = [_value(block, kind, weight) for row in rows for weight in row]
    return [array_of(values, (len(rows), len(inputs)))]


def _value(block: Block, kind: Kind, weight: Weight) -> Value:
    """A weight that may be a plain number."""
    return block.const(weight, kind) if isinstance(weight, float) else weight


def _arithmetic(block: Block, kind: Kind) -> Arithmetic:
    """Of a block's values, the weights of this kind."""

    def weight(value: Value) -> Weight:
        return value if value.constant is None else float(value.constant)

    def operation(op: str, *args: Weight) -> Weight:
        return weight(block.add(op, *(_value(block, kind, arg) for arg in args), kind=kind))

    def choice(which: Array, _: object) -> tuple[Weight, Weight]:
        here = convert(block, which.item(), Kind.BOOL)
        return operation("select", here, 1.0, 0.0), operation("select", here, 0.0, 1.0)

    return Arithmetic(
        literal=functools.partial(_literal, block),
        evaluate=functools.partial(_apply, block),
        weight=lambda array: weight(array.item()),
        product=functools.partial(operation, "fmul"),
        sum=functools.partial(operation, "fadd"),
        negative=functools.partial(operation, "fneg"),
        inverse=functools.partial(operation, "fdiv", 1.0),
        choice=choice,
    )


def _branches(block: Block, branches: Sequence[ClosedJaxpr], inputs: list[Array]) -> list[Array]:
    """A conditional: each branch runs where any lane takes it."""
    which, operands = inputs[0].item(), inputs[1:]
    if which.constant is not None:
        chosen = branches[min(max(int(which.constant), 0), len(branches) - 1)]
        return lower_jaxpr(block, chosen.jaxpr, chosen.consts, operands)
    results: list[Array] | None = None
    for number, branch in enumerate(branches):
        if results is None:
            # The first one needs no condition of its own: the rest replace what it gives.
            results = lower_jaxpr(block, branch.jaxpr, branch.consts, operands)
            continue
        here = _is(block, which, number, len(branches))
        results = _conditional(block, here, branch, operands, results)
    assert results is not None
    return results


def _is(block: Block, which: Value, number: int, count: int) -> Value:
    """Whether a branch's number is this one; numbers out of range are clamped."""
    if which.kind is Kind.BOOL:
        return which
    if which.op == "select" and count == 2 and which.args[1].constant == 1:
        return which.args[0]
    how = "icmp sge" if number == count - 1 else "icmp eq"
    return block.add(how, which, block.const(number, which.kind), kind=Kind.BOOL)


def _conditional(
    block: Block, here: Value, branch: ClosedJaxpr, operands: list[Array], otherwise: list[Array]
) -> list[Array]:
    inside = Block(block)
    found = lower_jaxpr(inside, branch.jaxpr, branch.consts, operands)
    values = [v for array in found for v in array.ravel()]
    defaults = [v for array in otherwise for v in array.ravel()]
    kinds = [v.kind for v in values]
    results = block.region("if", (here, inside, tuple(values), tuple(defaults)), kinds)
    return _reshape(results, found)


def _reshape(values: Sequence[Value], like: list[Array]) -> list[Array]:
    ends = itertools.accumulate(array.size for array in like)
    return [
        array_of(values[end - a.size : end], a.shape) for a, end in zip(like, ends, strict=True)
    ]


def _scan(block: Block, params: dict[str, Any], inputs: list[Array]) -> list[Array]:
    jaxpr, length = params["jaxpr"], params["length"]
    constants, carried = scan_counts(params)
    fixed, carry = inputs[:constants], inputs[constants : constants + carried]
    items = inputs[constants + carried :]
    body = jaxpr.jaxpr
    outputs = len(body.outvars) - carried
    long = length > _LONGEST_UNROLLED or length * _size(body) > _LARGEST_UNROLLED
    if not carried and long:
        return _map(block, jaxpr, fixed, items, length)
    if not items and not outputs and long:
        return _repeat(block, jaxpr, fixed, carry, length)
    collected: list[list[Array]] = [[] for _ in range(outputs)]
    for step in range(length):
        place = length - 1 - step if params["reverse"] else step
        chosen = [np.asarray(item[place], dtype=object) for item in items]
        results = lower_jaxpr(block, body, jaxpr.consts, [*fixed, *carry, *chosen])
        carry = results[:carried]
        for column, value in zip(collected, results[carried:], strict=True):
            column.append(value)
    if params["reverse"]:
        collected = [column[::-1] for column in collected]
    if not length:
        shapes = [variable.aval.shape for variable in body.outvars[carried:]]
        return [*carry, *(np.empty((0, *shape), dtype=object) for shape in shapes)]
    return [*carry, *(np.stack(column) for column in collected)]


def _size(jaxpr: Jaxpr) -> int:
    """How many equations a jaxpr has, with those inside of calls and of derivatives."""
    count = 0
    for equation in jaxpr.eqns:
        inner = called_program(equation)
        count += 1 if inner is None else _size(inner[0])
        count += _size(equation.params["program"]) if equation.primitive is JACOBIAN else 0
    return count


def _repeat(
    block: Block, jaxpr: ClosedJaxpr, fixed: list[Array], carry: list[Array], length: int
) -> list[Array]:
    inside = Block(block, loop=True)
    starts = [v for array in carry for v in array.ravel()]
    held = inside.region("held", (), [v.kind for v in starts])
    found = lower_jaxpr(inside, jaxpr.jaxpr, jaxpr.consts, [*fixed, *_reshape(held, carry)])
    ends = tuple(v for array in match_kinds(inside, found, carry) for v in array.ravel())
    args = (length, inside, tuple(starts), tuple(held), ends)
    return _reshape(block.region("repeat", args, [v.kind for v in starts]), carry)


def _map(
    block: Block, jaxpr: ClosedJaxpr, fixed: list[Array], items: list[Array], length: int
) -> list[Array]:
    """One run of the body for each entry along the leading axes, kept apart in memory."""
    inside = Block(block, loop=True)
    rows = [np.moveaxis(item, 0, -1).reshape(-1, length) for item in items]
    every = [tuple(row) for array in rows for row in array]
    # What is the same in every entry is known before the loop.
    same = [all(value is row[0] for value in row) for row in every]
    flat = [row for row, alike in zip(every, same, strict=True) if not alike]
    taken = inside.region("taken", (tuple(flat),), [row[0].kind for row in flat])
    left = iter(taken)
    given = [row[0] if alike else next(left) for row, alike in zip(every, same, strict=True)]
    shapes = [np.empty(item.shape[1:], dtype=object) for item in items]
    found = lower_jaxpr(inside, jaxpr.jaxpr, jaxpr.consts, [*fixed, *_reshape(given, shapes)])
    values = tuple(v for array in found for v in array.ravel())
    args = (length, inside, tuple(taken), values)
    kinds = [v.kind for v in values for _ in range(length)]
    results = array_of(block.region("map", args, kinds), (len(values), length))
    for row, value in zip(results, values, strict=True):
        if value.block is not inside:
            row[:] = value
    shapes = [np.empty((*array.shape, length), dtype=object) for array in found]
    return [np.moveaxis(each, -1, 0) for each in _reshape(results.ravel().tolist(), shapes)]
