"""LLVM function builder: instructions, memory and vectors as text."""

import struct
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager

from jaxbiped.compiler.ir._graph import Kind

_SHORT = {Kind.F64: "f64", Kind.F32: "f32", Kind.I64: "i64", Kind.I32: "i32", Kind.BOOL: "i1"}
BYTES = {Kind.F64: 8, Kind.F32: 4, Kind.I64: 8, Kind.I32: 4, Kind.BOOL: 1}
RARELY = ", !prof !0"
"""Behind a branch that is hardly ever taken; see `WEIGHTS`."""
WEIGHTS = '!0 = !{!"branch_weights", i32 1, i32 1048575}'
"""What `RARELY` refers to, in the module."""


def literal(number: float, kind: Kind) -> str:
    """A number as LLVM writes it."""
    if kind.is_float:
        return f"0x{struct.unpack('<Q', struct.pack('<d', number))[0]:016X}"
    return str(int(number))


def vector(kind: Kind, width: int) -> str:
    """LLVM's type of one value in `width` lanes."""
    return kind.value if width == 1 else f"<{width} x {kind.value}>"


class FunctionBuilder:
    """One function as it is written.

    Attributes:
        lines: its text so far; `allocations` what its entry allocates.
        declarations: of the functions that it calls.
        label: of the basic block that is being written.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.allocations: list[str] = []
        self.declarations: set[str] = set()
        self.label = "entry"
        self._scopes: list[dict[Hashable, str]] = [{}]
        self._count = 0

    def fresh(self, stem: str = "v") -> str:
        self._count += 1
        return f"{stem}{self._count}"

    def line(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def assign(self, text: str) -> str:
        """Adds an instruction with a result; its name."""
        name = "%" + self.fresh()
        self.lines.append(f"  {name} = {text}")
        return name

    def begin(self, label: str) -> None:
        self.lines.append(f"{label}:")
        self.label = label

    @contextmanager
    def writing_at_entry(self) -> Iterator[None]:
        """What is written within runs once, behind all that is allocated so far."""
        self.lines, self.allocations = self.allocations, self.lines
        yield
        self.lines, self.allocations = self.allocations, self.lines

    @contextmanager
    def scope(self) -> Iterator[None]:
        """What is loaded within is forgotten after."""
        self._scopes.append({})
        yield
        self._scopes.pop()

    @contextmanager
    def loop(self, length: int | str, *, index: str = "i", step: int = 1) -> Iterator[str]:
        """What is written within runs until its number, which it gives, is `length`."""
        start, again, after = self.label, self.fresh("again"), self.fresh("after")
        self.line(f"br label %{again}")
        self.begin(again)
        counter, following = "%" + self.fresh(index), "%" + self.fresh(index)
        at = len(self.lines)
        yield counter
        phi = f"phi i64 [ 0, %{start} ], [ {following}, %{self.label} ]"
        self.lines.insert(at, f"  {counter} = {phi}")
        self.line(f"{following} = add i64 {counter}, {step}")
        more = self.assign(f"icmp slt i64 {following}, {length}")
        self.line(f"br i1 {more}, label %{again}, label %{after}")
        self.begin(after)

    @contextmanager
    def where(self, condition: str, hint: str = "") -> Iterator[None]:
        """What is written within runs only where a condition holds; `hint` may be `RARELY`."""
        here, after = self.fresh("where"), self.fresh("after")
        self.line(f"br i1 {condition}, label %{here}, label %{after}{hint}")
        self.begin(here)
        yield
        self.line(f"br label %{after}")
        self.begin(after)

    def room(self, kind: Kind, count: int) -> str:
        """Memory of the function for a number of numbers."""
        name = "%" + self.fresh("m")
        self.allocations.append(f"  {name} = alloca [{count} x {_memory(kind)}], align 64")
        return name

    def address(self, pointer: str, kind: Kind, offset: int | str) -> str:
        """Address of an element; `offset` counts numbers."""
        if offset == 0:
            return pointer
        return self.assign(f"getelementptr {_memory(kind)}, ptr {pointer}, i64 {offset}")

    def load(self, pointer: str, kind: Kind, width: int) -> str:
        align = _alignment(kind, width)
        if kind is not Kind.BOOL:
            return self.assign(f"load {vector(kind, width)}, ptr {pointer}, align {align}")
        raw = self.assign(f"load {_bytes(width)}, ptr {pointer}, align {align}")
        return self.assign(f"trunc {_bytes(width)} {raw} to {vector(kind, width)}")

    def store(self, text: str, pointer: str, kind: Kind, width: int) -> None:
        align = _alignment(kind, width)
        if kind is Kind.BOOL:
            text = self.assign(f"zext {vector(kind, width)} {text} to {_bytes(width)}")
            self.line(f"store {_bytes(width)} {text}, ptr {pointer}, align {align}")
        else:
            self.line(f"store {vector(kind, width)} {text}, ptr {pointer}, align {align}")

    def splat_constant(self, text: str, kind: Kind, width: int) -> str:
        if width == 1:
            return text
        return "<" + ", ".join([f"{kind.value} {text}"] * width) + ">"

    def splat(self, text: str, kind: Kind, width: int) -> str:
        """A scalar in every lane."""
        many = vector(kind, width)
        one = self.assign(f"insertelement {many} poison, {kind.value} {text}, i64 0")
        zeros = f"<{width} x i32> zeroinitializer"
        return self.assign(f"shufflevector {many} {one}, {many} poison, {zeros}")

    def any_lane(self, mask: str, width: int) -> str:
        """Whether a mask holds in any lane."""
        if width == 1:
            return mask
        name = f"llvm.vector.reduce.or.v{width}i1"
        self.declarations.add(f"declare i1 @{name}(<{width} x i1>)")
        return self.assign(f"call i1 @{name}(<{width} x i1> {mask})")

    def intrinsic(
        self, stem: str, kinds: Sequence[Kind], operands: Sequence[str], width: int
    ) -> str:
        """A call of one of LLVM's own functions; `kinds` of the result and of the operands."""
        short = _SHORT[kinds[0]] if width == 1 else f"v{width}{_SHORT[kinds[0]]}"
        name = f"llvm.{stem}.{short}"
        types = [vector(kind, width) for kind in kinds]
        self.declarations.add(f"declare {types[0]} @{name}({', '.join(types[1:])})")
        given = ", ".join(f"{t} {o}" for t, o in zip(types[1:], operands, strict=True))
        return self.assign(f"call {types[0]} @{name}({given})")

    def cached(self, key: Hashable, make: Callable[[], str]) -> str:
        """What was made for a key in a scope around this place, or what is made now."""
        for scope in self._scopes:
            if key in scope:
                return scope[key]
        found = make()
        self._scopes[-1][key] = found
        return found


def _memory(kind: Kind) -> str:
    return "i8" if kind is Kind.BOOL else kind.value


def _bytes(width: int) -> str:
    return "i8" if width == 1 else f"<{width} x i8>"


def _alignment(kind: Kind, width: int) -> int:
    size = BYTES[kind] * width
    return size & -size
