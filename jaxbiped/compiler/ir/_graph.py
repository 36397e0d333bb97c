"""Graph of scalar operations: each computed once, what is constant folded away."""

import enum
import itertools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np

_T = TypeVar("_T")
Argument: TypeAlias = Any
"""Of an operation: a value; of a constant its number, of a region also blocks and tuples."""


class Kind(enum.Enum):
    """What a value holds in each lane. The value of a member is its LLVM type."""

    F64 = "double"
    F32 = "float"
    I64 = "i64"
    I32 = "i32"
    BOOL = "i1"

    is_float: bool
    """Whether it is a floating-point number."""

    def __init__(self, text: str) -> None:
        self.is_float = text in ("double", "float")

    # Members are compared by identity. That of `Enum`, by the name, takes long in keys.
    __hash__ = object.__hash__


_NUMBER = itertools.count()


class Value:
    """The result of one operation.

    Attributes:
        op: name of the operation.
        args: values, blocks or plain numbers that it takes.
        kind: what it holds.
        block: where it is computed.
        number: the order in which values were made.
        logarithm_of: of a logarithm, what it is the logarithm of; else None.
    """

    __slots__ = ("args", "block", "kind", "logarithm_of", "number", "op")

    def __init__(self, op: str, args: tuple[Argument, ...], kind: Kind, block: "Block") -> None:
        self.op, self.args, self.kind, self.block = op, args, kind, block
        self.number = next(_NUMBER)
        self.logarithm_of: Value | None = None

    @property
    def constant(self) -> float | None:
        """The number that it always is, or None."""
        return self.args[0] if self.op == "const" else None


class Block:
    """Operations in order. Those of the blocks around it are known in it.

    Attributes:
        parent: the block around it.
        values: what it computes, in order.
        invariant: whether what it computes depends on a simulation's inputs alone; then what
            blocks inside compute of such values alone is moved here.
        loop: whether it is run several times; what does not depend on the run is moved out.
        rare: whether it is hardly ever run: registers are not saved on the way around it.
    """

    def __init__(
        self,
        parent: "Block | None" = None,
        *,
        invariant: bool = False,
        loop: bool = False,
        rare: bool = False,
    ) -> None:
        self.parent, self.invariant, self.loop, self.rare = parent, invariant, loop, rare
        self.values: list[Value] = []
        self._lineage: list[Block] = [self, *(() if parent is None else parent._lineage)]
        self._known: dict[tuple[Argument, ...], Value] = {}
        self._called: dict[tuple[Any, ...], Any] = {}
        self._callers: list[Block] = []

    def lineage(self) -> "list[Block]":
        """This block, the one around it, and so on."""
        return self._lineage

    def const(self, number: float, kind: Kind) -> Value:
        number = bool(number) if kind is Kind.BOOL else number
        number = float(number) if kind.is_float else int(number)
        if kind is Kind.F32:
            number = float(np.float32(number))
        # The bits, not the number: −0 is not 0, and NaN is itself.
        key = np.float64(number).tobytes() if kind.is_float else number
        return self._root()._keep(("const", kind, key), "const", (number,), kind)

    def add(self, op: str, *args: Argument, kind: Kind | None = None) -> Value:
        """The value of an operation: an equal one that is known already, or a new one."""
        result = kind if kind is not None else args[0].kind
        folded = _fold(self, op, args, result)
        if folded is not None:
            return folded
        if op in _COMMUTATIVE and args[0].number > args[1].number:
            args = (args[1], args[0])
        key = (op, result, *(a if isinstance(a, int | float | str) else id(a) for a in args))
        for block in self._lineage:
            known = block._known.get(key)
            if known is not None:
                return known
        return self.home(args)._keep(key, op, args, result)

    def home(self, args: Sequence[Argument]) -> "Block":
        """Where to compute what depends on these alone."""
        values = [a for a in args if isinstance(a, Value)]
        if values and all(v.block.invariant or v.op == "const" for v in values):
            return next((block for block in self.lineage() if block.invariant), self)
        if self.loop and self.parent is not None and all(v.block is not self for v in values):
            return self.parent.home(args)
        return self

    def shared(self, name: str, args: Sequence[Value], make: "Callable[[Block], Value]") -> Value:
        """What `make` makes of values, made once."""
        key = (name, *(id(a) for a in args))
        for block in self.lineage():
            if key in block._known:
                return block._known[key]
        home = self.home(args)
        home._known[key] = make(home)
        return home._known[key]

    def call(self, key: tuple[Any, ...], lower: Callable[[], _T]) -> _T:
        """What `lower` gives for a call, called once until calls are forgotten.

        `key` holds what is called, and the ids of values that live as long.
        """
        for block in self._lineage:
            if key in block._called:
                return block._called[key]
        if not self._called:
            self._root()._callers.append(self)
        found = self._called[key] = lower()
        return found

    def forget_calls(self) -> None:
        """In all blocks: what was called would live on with them."""
        for block in self._root()._callers:
            block._called.clear()
        self._root()._callers.clear()

    def region(self, op: str, args: tuple[Argument, ...], kinds: list[Kind]) -> list[Value]:
        """An operation of several results, never shared with another."""
        head = Value(op, args, Kind.BOOL, self)
        self.values.append(head)
        results = [Value("part", (head, i), kind, self) for i, kind in enumerate(kinds)]
        self.values.extend(results)
        return results

    def _keep(
        self, key: tuple[Argument, ...], op: str, args: tuple[Argument, ...], kind: Kind
    ) -> Value:
        found = self._known.get(key)
        if found is None:
            found = Value(op, args, kind, self)
            self._known[key] = found
            self.values.append(found)
        return found

    def _root(self) -> "Block":
        return self._lineage[-1]


_COMMUTATIVE = {"fadd", "fmul", "add", "mul", "and", "or", "xor"}


def _ieee(function: Callable[..., float]) -> Callable[..., float]:
    def apply(*args: float) -> float:
        with np.errstate(all="ignore"):
            return float(function(*(np.float64(a) for a in args)))

    return apply


_ORDERS = {"lt": operator.lt, "le": operator.le, "gt": operator.gt, "ge": operator.ge}
_NUMBERS: dict[str, Callable[..., float]] = {
    "fadd": _ieee(operator.add),
    "fsub": _ieee(operator.sub),
    "fmul": _ieee(operator.mul),
    "fdiv": _ieee(operator.truediv),
    "fneg": _ieee(operator.neg),
    "fabs": _ieee(np.abs),
    "sqrt": _ieee(np.sqrt),
    "and": operator.and_,
    "or": operator.or_,
    "xor": operator.xor,
    "not": operator.not_,
    "add": operator.add,
    "sub": operator.sub,
    **{f"fcmp o{how}": compare for how, compare in _ORDERS.items()},
    **{f"icmp s{how}": compare for how, compare in _ORDERS.items()},
    "icmp eq": operator.eq,
    "icmp ne": operator.ne,
}

_FOLDED = {*_NUMBERS, "select"}


def _fold(block: Block, op: str, args: tuple[Argument, ...], kind: Kind) -> Value | None:
    """What an operation comes to where its arguments are numbers, or do nothing."""
    if op not in _FOLDED:
        return None
    constants = [a.constant for a in args]
    if op in _NUMBERS and kind is not Kind.F32 and None not in constants:
        return block.const(_NUMBERS[op](*constants), kind)
    if op in ("fadd", "fsub", "fmul", "fdiv"):
        found = _fold_float(block, op, args, constants, kind)
        return _strip_signs(block, op, args) if found is None else found
    if op == "fneg" and args[0].op == "fneg":
        return args[0].args[0]
    if op in ("and", "or") and kind is Kind.BOOL:
        return _fold_boolean(op, args, constants)
    if op == "select":
        if constants[0] is not None:
            return args[1] if constants[0] else args[2]
        if args[1] is args[2]:
            return args[1]
    return None


def _fold_float(
    block: Block, op: str, args: tuple[Argument, ...], constants: list[float | None], kind: Kind
) -> Value | None:
    first, second = constants
    if op == "fadd" and 0.0 in (first, second):
        return args[1] if first == 0.0 else args[0]
    if op == "fsub":
        if second == 0.0:
            return args[0]
        if first == 0.0 and math.copysign(1.0, first) > 0.0:
            return block.add("fneg", args[1])
    # An entry that is zero by structure stays zero whatever it is multiplied with.
    if op == "fmul" and 0.0 in (first, second):
        return block.const(0.0, kind)
    if op == "fmul" and 1.0 in (first, second):
        return args[1] if first == 1.0 else args[0]
    if op == "fmul" and -1.0 in (first, second):
        return block.add("fneg", args[1] if first == -1.0 else args[0])
    if op == "fdiv" and second is not None:
        mantissa, _ = math.frexp(second)
        if second == 1.0:
            return args[0]
        if abs(mantissa) == 0.5 and abs(second) > 1e-300 and abs(second) < 1e300:
            return block.add("fmul", args[0], block.const(1.0 / second, kind))
    return None


def _strip_signs(block: Block, op: str, args: tuple[Argument, ...]) -> Value | None:
    """Changes of sign moved out of an operation, where a sum or difference absorbs them."""
    a, b = args
    negated = [a.op == "fneg", b.op == "fneg"]
    if not any(negated):
        return None
    x, y = (
        value.args[0] if negative else value for value, negative in zip(args, negated, strict=True)
    )
    if op in ("fmul", "fdiv"):
        found = block.add(op, x, y)
        return found if all(negated) else block.add("fneg", found)
    if op == "fadd":
        if all(negated):
            return block.add("fneg", block.add("fadd", x, y))
        return block.add("fsub", b, x) if negated[0] else block.add("fsub", a, y)
    if negated[1]:
        return block.add("fsub", y, x) if negated[0] else block.add("fadd", a, y)
    return block.add("fneg", block.add("fadd", x, b))


def _fold_boolean(
    op: str, args: tuple[Argument, ...], constants: list[float | None]
) -> Value | None:
    if args[0] is args[1]:
        return args[0]
    for constant, other in zip(constants, reversed(args), strict=True):
        if constant is not None:
            absorbs = bool(constant) == (op == "or")
            return args[constants.index(constant)] if absorbs else other
    return None
