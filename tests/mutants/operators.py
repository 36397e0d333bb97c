"""Operators: the slips that a node of the syntax tree can suffer, each with the tree it leaves."""

import ast
import copy
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple


class Slip(NamedTuple):
    """One way in which a node is wrong.

    Attributes:
        kind: what is wrong, such as "sign".
        instead: what stands in the node's place; None where the statement is dropped.
    """

    kind: str
    instead: ast.AST | None


def slips(node: ast.AST) -> list[Slip]:
    """All slips of a node; most nodes have none."""
    return [slip for operator in OPERATORS for slip in operator(node)]


def _changed(node: Any, **fields: Any) -> Any:
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return new


def sign(node: ast.AST) -> Iterator[Slip]:
    """Plus and minus are exchanged, or a minus is missing."""
    other = {ast.Add: ast.Sub, ast.Sub: ast.Add}
    if isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in other:
        if not _is_words(node):
            yield Slip("sign", _changed(node, op=other[type(node.op)]()))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield Slip("sign", node.operand)


def term(node: ast.AST) -> Iterator[Slip]:
    """A term, a factor, a divisor or an exponent is missing."""
    if not isinstance(node, ast.BinOp) or _is_words(node):
        return
    if isinstance(node.op, ast.Add | ast.Sub):
        yield Slip("term", node.left)
        right = node.right
        negated = isinstance(node.op, ast.Sub)
        yield Slip("term", ast.UnaryOp(ast.USub(), right) if negated else right)
    elif isinstance(node.op, ast.Mult):
        yield Slip("factor", node.left)
        yield Slip("factor", node.right)
        yield Slip("factor", _changed(node, op=ast.Div()))
    elif isinstance(node.op, ast.Div):
        yield Slip("factor", node.left)
        yield Slip("factor", _changed(node, op=ast.Mult()))
    elif isinstance(node.op, ast.Pow | ast.Mod | ast.FloorDiv):
        yield Slip("factor", node.left)


_BOUNDS = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
_OPPOSITES = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip


def comparison(node: ast.AST) -> Iterator[Slip]:
    """A comparison is the opposite one, or leaves out or takes in its bound."""
    if not isinstance(node, ast.Compare):
        return
    for k, op in enumerate(node.ops):
        for kind, other in (("bound", _BOUNDS), ("comparison", _OPPOSITES)):
            if type(op) in other:
                new: ast.cmpop = other[type(op)]()
                yield Slip(kind, _changed(node, ops=[*node.ops[:k], new, *node.ops[k + 1 :]]))


_SITES = (ast.Compare, ast.BoolOp)
"""Tests of a branch that are sites of their own."""


def condition(node: ast.AST) -> Iterator[Slip]:
    """`and` stands for `or`, a condition is missing, or is negated."""
    if isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield Slip("and-or", _changed(node, op=other))
        for k in range(len(node.values)):
            left = [*node.values[:k], *node.values[k + 1 :]]
            yield Slip("condition", left[0] if len(left) == 1 else _changed(node, values=left))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield Slip("condition", node.operand)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Invert):
        yield Slip("mask", node.operand)
    elif isinstance(node, ast.If | ast.While) and not isinstance(node.test, _SITES):
        yield Slip("condition", _changed(node, test=ast.UnaryOp(ast.Not(), node.test)))


def mask(node: ast.AST) -> Iterator[Slip]:
    """A choice always falls on one side, or one of two masks is missing."""
    if isinstance(node, ast.Call) and _called(node) == "where" and len(node.args) == 3:
        yield Slip("mask", node.args[1])
        yield Slip("mask", node.args[2])
    elif isinstance(node, ast.IfExp):
        yield Slip("mask", node.body)
        yield Slip("mask", node.orelse)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitAnd | ast.BitOr):
        other = ast.BitOr() if isinstance(node.op, ast.BitAnd) else ast.BitAnd()
        yield from (Slip("mask", node.left), Slip("mask", node.right))
        yield Slip("mask", _changed(node, op=other))


_PARTNERS = (
    ("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"), ("nanmin", "nanmax"),
    ("fmin", "fmax"), ("any", "all"), ("floor", "ceil"), ("zeros", "ones"), ("sin", "cos"),
    ("zeros_like", "ones_like"), ("union", "intersection"), ("first", "last"),
)  # fmt: skip
_OTHER = {a: b for pair in _PARTNERS for a, b in (pair, pair[::-1])}


def function(node: ast.AST) -> Iterator[Slip]:
    """Another function of a pair is called, such as min for max; or the size is not taken."""
    if not isinstance(node, ast.Call):
        return
    if (name := _called(node)) in _OTHER:
        new = _OTHER[name]
        named = isinstance(node.func, ast.Name)
        func = _changed(node.func, **{"id" if named else "attr": new})
        yield Slip("min-max", _changed(node, func=func))
    alone = len(node.args) == 1 and not isinstance(node.args[0], ast.Starred)
    if alone and name in ("abs", "sqrt", "sorted", "reversed", "stop_gradient"):
        yield Slip("function", node.args[0])


def exchange(node: ast.AST) -> Iterator[Slip]:
    """Two arguments that follow each other are exchanged, where neither is words or a function."""
    if not isinstance(node, ast.Call) or _called(node) in _FIRST_IS_SPECIAL:
        return
    args = node.args
    for k in range(len(args) - 1):
        pair = args[k : k + 2]
        if all(_is_value(arg) for arg in pair) and ast.dump(pair[0]) != ast.dump(pair[1]):
            yield Slip("arguments", _changed(node, args=[*args[:k], *pair[::-1], *args[k + 2 :]]))


_FIRST_IS_SPECIAL = (
    "isinstance", "issubclass", "getattr", "setattr", "hasattr", "map", "tree_map", "filter",
    "partial", "vmap", "astype", "full", "cast", "stage",
)  # fmt: skip
"""Calls whose first argument no one exchanges: a function, a class or a name before a value."""


def _is_value(node: ast.expr) -> bool:
    words = isinstance(node, ast.Constant) and not isinstance(node.value, int | float)
    return not words and not isinstance(node, ast.Starred | ast.Lambda | ast.JoinedStr)


ASSERTED = ("strict",)
"""Named arguments that assert what holds, as that `zip` is given as many of everything."""


def default(node: ast.AST) -> Iterator[Slip]:
    """A named argument is missing, so that its default holds."""
    if isinstance(node, ast.Call):
        for k, keyword in enumerate(node.keywords):
            if keyword.arg is not None and keyword.arg not in ASSERTED:
                left = [*node.keywords[:k], *node.keywords[k + 1 :]]
                yield Slip("default", _changed(node, keywords=left))


def index(node: ast.AST) -> Iterator[Slip]:
    """An index or the end of a slice is off by one, or the slice takes all."""
    if not isinstance(node, ast.Subscript):
        return
    if isinstance(node.slice, ast.Slice):
        for name in ("lower", "upper"):
            if getattr(node.slice, name) is not None:
                yield Slip("index", _changed(node, slice=_changed(node.slice, **{name: None})))
    elif (value := _integer(node.slice)) is not None:
        for step in (1, -1):
            yield Slip("index", _changed(node, slice=ast.Constant(value + step)))


def constant(node: ast.AST) -> Iterator[Slip]:
    """A number is another one, or true stands for false."""
    if not isinstance(node, ast.Constant):
        return
    value = node.value
    if isinstance(value, bool):
        yield Slip("constant", ast.Constant(not value))
    elif isinstance(value, int):
        yield Slip("constant", ast.Constant(value + 1))
        yield from [Slip("constant", ast.Constant(value - 1))] if value else []
    elif isinstance(value, float):
        yield Slip("constant", ast.Constant(2.0 * value if value else 1.0))
        yield from [Slip("constant", ast.Constant(0.5 * value))] if value else []


_LEAVING = (ast.Return, ast.Raise, ast.Continue, ast.Break)


def statement(node: ast.AST) -> Iterator[Slip]:
    """A call for its effect, an early end or what is always done at last is missing."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield Slip("call", None)
    elif isinstance(node, ast.If) and not node.orelse and isinstance(node.body[-1], _LEAVING):
        if len(node.body) == 1:
            yield Slip("early-end", None)
    elif isinstance(node, ast.AugAssign | ast.Delete):
        yield Slip("call", None)


KEYS = ("key", "fingerprint", "structure", "static")


def key(node: ast.AST) -> Iterator[Slip]:
    """A part is missing in what a cache knows a thing by."""
    if isinstance(node, ast.Assign) and len(node.targets) == 1:
        named = isinstance(node.targets[0], ast.Name) and _is_key(node.targets[0].id)
        made = node.value
        if named and isinstance(made, ast.Tuple):
            yield from (Slip("key", _changed(node, value=t)) for t in _shorter(made))
    elif isinstance(node, ast.FunctionDef) and _is_key(node.name):
        for k, inner in enumerate(node.body):
            if isinstance(inner, ast.Return) and isinstance(inner.value, ast.Tuple):
                for shorter in _shorter(inner.value):
                    body = [*node.body[:k], _changed(inner, value=shorter), *node.body[k + 1 :]]
                    yield Slip("key", _changed(node, body=body))
    elif isinstance(node, ast.Call) and _is_key(_called(node)) and len(node.args) > 1:
        for k in range(len(node.args)):
            yield Slip("key", _changed(node, args=[*node.args[:k], *node.args[k + 1 :]]))
    elif isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Call):
        static = [k for k in node.value.keywords if k.arg == "static"]
        if static:
            left = [k for k in node.value.keywords if k.arg != "static"]
            yield Slip("key", _changed(node, value=_changed(node.value, keywords=left)))


OPERATORS: tuple[Callable[[ast.AST], Iterator[Slip]], ...] = (
    sign, term, comparison, condition, mask, function, exchange, default, index, constant,
    statement, key,
)  # fmt: skip


def _is_key(name: str) -> bool:
    return any(word in KEYS for word in name.lower().strip("_").split("_"))


def _shorter(made: ast.Tuple) -> Iterator[ast.Tuple]:
    for k in range(len(made.elts) if len(made.elts) > 1 else 0):
        yield ast.Tuple([*made.elts[:k], *made.elts[k + 1 :]], ast.Load())


def _called(node: ast.Call) -> str:
    """The name of what is called, without the module or object that it is of."""
    func = node.func
    return func.attr if isinstance(func, ast.Attribute) else getattr(func, "id", "")


def _integer(node: ast.expr) -> int | None:
    """The integer that an index is, with its sign."""
    try:
        value = ast.literal_eval(node)
    except (ValueError, TypeError):
        return None
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _is_words(node: ast.AST) -> bool:
    """Whether text is joined or formatted rather than numbers."""
    parts = [getattr(node, name, None) for name in ("left", "right", "value")]
    return any(
        isinstance(part, ast.JoinedStr) or isinstance(getattr(part, "value", None), str)
        for part in parts
    )
