"""Host writer: a program of JAX as the text of a Python function of NumPy's arrays.

What runs a few times, between calls of programs that do the work, takes XLA seconds to compile and
NumPy milliseconds to run. What is the same in every run is computed here, what is the same in every
turn of a loop before the loop, and equal operations once.
"""

import dataclasses
from collections.abc import Callable, Hashable, Sequence
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from jax.extend.core import Jaxpr, JaxprEqn, Literal

from jaxbiped._types import Numbers
from jaxbiped.compiler.host_code import _arrays

_OF_NUMPY = (
    "abs add arccos arcsin arctan arctan2 array ceil complex128 concatenate conj cos cosh einsum "
    "exp expm1 float32 float64 floor fmod full int32 int64 isfinite log log1p log2 logical_and "
    "logical_or maximum minimum multiply nextafter rint sign sin sinh sqrt stack tan tanh where"
)
NAMES: dict[str, Any] = {name: getattr(np, name) for name in _OF_NUMPY.split()} | {
    name: each for name, each in vars(_arrays).items() if isinstance(each, FunctionType)
}
"""What a text may use beside its own constants."""


class UnwrittenError(NotImplementedError):
    """A JAX operation that has no form in NumPy here."""


@dataclasses.dataclass(eq=False)
class Block:
    """Statements that run together: the function's, a loop's body or a branch.

    Attributes:
        outer: what it is within.
        branch: whether it runs only on a condition: nothing is taken out of such.
        lines: its text.
        known: values by what they are computed as.
    """

    outer: "Block | None" = None
    branch: bool = False
    lines: list[str] = dataclasses.field(default_factory=list)
    known: dict[str, "tuple[Value, ...]"] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        self.lineage: list[Block] = [self, *(() if self.outer is None else self.outer.lineage)]
        self.depth = len(self.lineage)
        innermost = self.branch or self.outer is None
        self.least: int = self.depth if innermost or self.outer is None else self.outer.least


@dataclasses.dataclass(eq=False)
class Value:
    """One value of a program.

    Attributes:
        block: where it is computed.
        shape, dtype: as the program has it.
        held: shape of what the text holds: NumPy spreads it in operations entry by entry.
        name: in the text; None for what no text needs so far.
        constant: where it is the same in every run.
        part: the array and the indices of which it is a part.
        form: what it is computed as, and of what, where that is not written yet.
    """

    block: Block
    shape: tuple[int, ...]
    dtype: Any
    held: tuple[int, ...]
    name: str | None = None
    constant: Any = None
    part: "tuple[Value, tuple[slice | int, ...]] | None" = None
    form: "tuple[str, Value] | None" = None


class Operation(NamedTuple):
    """One operation of a program.

    Attributes:
        equation: of a jaxpr.
        inputs: what it reads.
        needs: which of its results anything reads.
    """

    equation: JaxprEqn
    inputs: list[Value]
    needs: list[bool]

    @property
    def params(self) -> dict[str, Any]:
        """What tells it from others of its kind."""
        return self.equation.params

    def result(self, place: int = 0) -> tuple[tuple[int, ...], np.dtype]:
        """Shape and type of a result."""
        aval: Any = self.equation.outvars[place].aval
        return tuple(aval.shape), np.dtype(aval.dtype)

    def results(self) -> list[tuple[tuple[int, ...], np.dtype, tuple[int, ...]]]:
        """Those of all of them, and what is held of each."""
        found = [self.result(k) for k in range(len(self.equation.outvars))]
        return [(shape, dtype, shape) for shape, dtype in found]


def listed(count: int, first: int = 0) -> str:
    """Inputs in a form, one after the other."""
    return ", ".join(f"{{{i}}}" for i in range(first, first + count))


class HostWriter:
    """A text under way."""

    def __init__(self, rules: dict[str, "Rule"]) -> None:
        self._rules, self._count = rules, 0
        self._named: dict[Hashable, str] = {}
        self.block = Block()
        self.constants: dict[str, Any] = {}

    def fresh(self, letter: str = "v") -> str:
        """A name that nothing has."""
        self._count += 1
        return f"{letter}{self._count}"

    def constant(self, value: Any, dtype: Any = None) -> Value:
        """A number or array that is the same in every run."""
        known = np.asarray(value, dtype=dtype)
        return Value(
            self.block.lineage[-1], known.shape, known.dtype, known.shape, constant=known[()]
        )

    def thing(self, value: Any, key: Hashable = None) -> str:
        """The name of a constant, or of what is no array; equal ones of a `key` have one."""
        key = (type(value), value) if key is None else key
        if key not in self._named:
            self._named[key] = name = self.fresh("k")
            self.constants[name] = value
        return self._named[key]

    def text(self, value: Value) -> str:
        if value.form is not None:
            # Where it belongs, even if only a branch is written that needs it.
            form, base = value.form
            text = form.format(self.text(base))
            result = value.shape, value.dtype, value.held
            (written,) = self._known(value.block, text) or self._add(value.block, text, [result])
            value.name, value.form = written.name, None
        if value.name is None:
            numbers = np.asarray(value.constant)
            key = "array", str(numbers.dtype), numbers.shape, numbers.tobytes()
            value.name = self.thing(value.constant, key)
        return value.name

    def emit(
        self,
        form: str,
        inputs: Sequence[Value],
        shape: Sequence[int],
        dtype: Any,
        held: Sequence[int] | None = None,
    ) -> Value:
        """What an expression gives, in whose `form` the inputs belong at {0}, {1}, …"""
        return self.emit_all(form, inputs, [(shape, dtype, shape if held is None else held)])[0]

    def emit_whole(self, form: str, op: Operation) -> list[Value]:
        """What an expression of an operation's inputs gives, all held in their whole shapes."""
        return [self.emit(form, [self.full(each) for each in op.inputs], *op.result())]

    def later(self, form: str, base: Value, shape: Sequence[int]) -> Value:
        """`emit` of one input, where it turns out to be needed."""
        if base.constant is not None:
            return self.emit(form, [base], shape, base.dtype)
        block = self._block_for([base])
        return Value(block, tuple(shape), base.dtype, tuple(shape), form=(form, base))

    def emit_all(
        self,
        form: str,
        inputs: Sequence[Value],
        results: Sequence[tuple[Any, Any, Any]],
        *,
        computed: bool = True,
    ) -> tuple[Value, ...]:
        """The same for as many results, each with its shape, its dtype and what is held of it.

        Where all inputs are known it is `computed` at once.
        """
        if computed and all(each.constant is not None for each in inputs):
            names = [f"c{i}" for i in range(len(inputs))]
            given = dict(zip(names, (each.constant for each in inputs), strict=True))
            with np.errstate(all="ignore"):
                found = eval(form.format(*names), NAMES | self.constants | given)
            found = (found,) if len(results) == 1 else tuple(found)
            return tuple(
                Value(self.block.lineage[-1], tuple(shape), dtype, tuple(held), constant=each)
                for each, (shape, dtype, held) in zip(found, results, strict=True)
            )
        text = form.format(*map(self.text, inputs))
        block = self._block_for(inputs)
        known = self._known(block, text) or self._add(block, text, results)
        # The same text may stand for other shapes than where it was written first.
        shapes = (tuple(shape) for shape, *_ in results)
        return tuple(dataclasses.replace(k, shape=s) for k, s in zip(known, shapes, strict=True))

    def full(self, value: Value) -> Value:
        """The same, held in its whole shape."""
        if value.held == value.shape:
            return value
        form = f"full({value.shape!r}, {{0}})"
        return self.emit(form, [value], value.shape, value.dtype)

    def inline(
        self,
        jaxpr: Jaxpr,
        consts: Sequence[Numbers],
        inputs: Sequence[Value],
        wanted: Sequence[bool] | None = None,
    ) -> list[Value | None]:
        """Writes a program's operations: its results, None for those that are not `wanted`.

        Raises:
            UnwrittenError: it holds an operation that has no form here.
        """
        known: dict[Any, Value] = dict(zip(jaxpr.invars, inputs, strict=True))
        known.update(zip(jaxpr.constvars, map(self.constant, consts), strict=True))

        def read(atom: Any) -> Value:
            if isinstance(atom, Literal):
                aval: Any = atom.aval
                return self.constant(atom.val, np.dtype(aval.dtype))
            return known[atom]

        wanted = [True] * len(jaxpr.outvars) if wanted is None else wanted
        for equation, needs in _needed(jaxpr, wanted):
            rule = self._rules.get(equation.primitive.name)
            if rule is None:
                raise UnwrittenError(f"the JAX primitive {equation.primitive.name!r}")
            found = rule(self, Operation(equation, list(map(read, equation.invars)), needs))
            known.update((v, f) for v, f in zip(equation.outvars, found, strict=True) if f)
        return [
            read(atom) if wants else None for atom, wants in zip(jaxpr.outvars, wanted, strict=True)
        ]

    def inside(self, block: Block, write: Callable[[], Any]) -> Any:
        """What `write` gives, with its statements in another block."""
        before, self.block = self.block, block
        try:
            return write()
        finally:
            self.block = before

    @staticmethod
    def _known(block: Block, text: str) -> tuple[Value, ...] | None:
        """What an expression gave that was written in a block or around it."""
        return next((at.known[text] for at in block.lineage if text in at.known), None)

    def _add(
        self, block: Block, text: str, results: Sequence[tuple[Any, Any, Any]]
    ) -> tuple[Value, ...]:
        """What an expression gives, at the end of a block."""
        made = tuple(
            Value(block, tuple(shape), dtype, tuple(held), self.fresh())
            for shape, dtype, held in results
        )
        block.lines.append(f"{', '.join(str(each.name) for each in made)} = {text}")
        block.known[text] = made
        return made

    def _block_for(self, inputs: Sequence[Value]) -> Block:
        """The outermost block where an operation on these may stand."""
        depth = max([self.block.least, *(each.block.depth for each in inputs)])
        return next(block for block in self.block.lineage if block.depth <= depth)


Rule = Callable[[HostWriter, Operation], Sequence[Value | None]]
"""Writes one operation: its results, of which only some are needed."""


def _needed(jaxpr: Jaxpr, wanted: Sequence[bool]) -> list[tuple[JaxprEqn, list[bool]]]:
    """The equations that the wanted results need, each with which of its own are."""
    needed = {id(a) for a, wants in zip(jaxpr.outvars, wanted, strict=True) if wants}
    found = []
    for equation in reversed(jaxpr.eqns):
        mask = [id(variable) in needed for variable in equation.outvars]
        if any(mask):
            needed.update(map(id, equation.invars))
            found.append((equation, mask))
    return found[::-1]
