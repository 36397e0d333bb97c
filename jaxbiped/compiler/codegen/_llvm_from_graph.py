"""Graph code generation: LLVM's text, each value one vector over the lanes."""

import contextlib
import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

from jaxbiped.compiler.codegen._kernel_target import KernelTarget, select_fused, select_instruction
from jaxbiped.compiler.codegen._llvm_function import RARELY, FunctionBuilder, literal, vector
from jaxbiped.compiler.ir._graph import Block, Kind, Value
from jaxbiped.compiler.ir._liveness import Liveness


class Place(NamedTuple):
    """Where a value lies in memory: `offset` vectors of the function's width behind `pointer`."""

    pointer: str
    offset: int


class GraphWriter:
    """Writes one function.

    Attributes:
        width: lanes of a vector, one simulation each.
        inner: lanes of a vector over the entries of a map, where `width` is one.
        target: what it is written for.
        text: what is written so far.
        padded_rooms: memory whose rows are whole vectors, for maps where `width` is one.
        homes: values that lie in memory, loaded where they are used.
        needed: what is to be computed.
    """

    def __init__(self, target: KernelTarget, needed: Liveness) -> None:
        self.width, self.inner = target.width, target.inner
        self.target, self.needed = target, needed
        self.text = FunctionBuilder()
        self.homes: dict[int, Place] = {}
        self.padded_rooms: set[str] = set()
        self._names: dict[int, tuple[str, int]] = {}

    def room(self, kind: Kind, vectors: int) -> str:
        """Memory of the function for a number of vectors."""
        return self.text.room(kind, vectors * self.width)

    def padded(self, length: int) -> int:
        """Entries that a map over `length` of them has room for."""
        step = self.inner if self.width == 1 else 1
        return -(-length // step) * step

    def name(self, value: Value, text: str, width: int | None = None) -> None:
        self._names[id(value)] = (text, self.width if width is None else width)

    def use(self, value: Value, width: int | None = None) -> str:
        """A value as an operand of an instruction of this width."""
        width = self.width if width is None else width
        constant = value.constant
        if constant is not None:
            return self.text.splat_constant(literal(constant, value.kind), value.kind, width)
        text, known_width = self._named(value)
        if known_width == width:
            return text
        return self.text.cached(
            ("splat", text, width), lambda: self.text.splat(text, value.kind, width)
        )

    def write(
        self,
        block: Block,
        width: int | None = None,
        known: Callable[[Value], None] = lambda value: None,
    ) -> None:
        """Writes all of a block that is needed; `known` receives what has been computed."""
        width = self.width if width is None else width
        for value in block.values:
            if value not in self.needed or id(value) in self.needed.absorbed:
                continue
            if id(value) in self.homes or value.op in ("const", "part", "input"):
                continue
            if value.op == "if":
                self._write_if(value, width)
            elif value.op == "repeat":
                self._write_repeat(value, width)
            elif value.op == "map":
                self._write_map(value)
            elif value.op not in ("held", "taken"):
                self.name(value, self._operation(value, width), width)
                known(value)

    def _operation(self, value: Value, width: int) -> str:
        place = self.needed.fused.get(id(value))
        if place is not None:
            factors = [self.use(factor, width) for factor in value.args[place].args]
            other = self.use(value.args[1 - place], width)
            return select_fused(self.text, value.op, value.kind, factors, other, place, width)
        values = [arg for arg in value.args if isinstance(arg, Value)]
        kinds = [value.kind, *(arg.kind for arg in values)]
        operands = [self.use(arg, width) for arg in values]
        return select_instruction(self.text, value.op, kinds, operands, width, self.target)

    def _named(self, value: Value) -> tuple[str, int]:
        place = self.homes.get(id(value))
        if place is None:
            return self._names[id(value)]
        key = ("load", place)
        found = self.text.cached(key, lambda: self._load_from(place, value.kind))
        return found, self.width

    def _load_from(self, place: Place, kind: Kind) -> str:
        at = self.text.address(place.pointer, kind, place.offset * self.width)
        return self.text.load(at, kind, self.width)

    def _write_if(self, head: Value, width: int) -> None:
        """The inner block runs where any lane wants it; each lane then takes its own."""
        here, inside, values, defaults = head.args
        parts = _parts_of(head)
        every = [i for i, part in enumerate(parts) if part in self.needed]
        stored = [i for i in every if width == 1 and self._stays_stored(head, i)]
        wanted = [i for i in every if i not in stored]
        mask = self.use(here, width)
        before = [self.use(defaults[i], width) for i in wanted]
        start, hint = self.text.label, RARELY if inside.rare else ""
        chosen, either = [], dict[tuple[str, str, int], str]()
        with self.text.where(self.text.any_lane(mask, width), hint), self.text.scope():
            self.write(inside, width)
            for i in stored:
                apart = self._apart(values[i], defaults[i])
                if apart not in either:
                    either[apart] = self.text.address(apart[0], values[i].kind, apart[2])
            for i, old in zip(wanted, before, strict=True):
                of, new = vector(values[i].kind, width), self.use(values[i], width)
                text = f"select {vector(Kind.BOOL, width)} {mask}, {of} {new}, {of} {old}"
                chosen.append(self.text.assign(text))
            end = self.text.label
        for i, old, new in zip(wanted, before, chosen, strict=True):
            of = vector(values[i].kind, width)
            text = f"phi {of} [ {old}, %{start} ], [ {new}, %{end} ]"
            self.name(parts[i], self.text.assign(text), width)
        for apart, moved in either.items():
            one, other, distance = apart
            pointer = self.text.assign(f"phi ptr [ {other}, %{start} ], [ {moved}, %{end} ]")
            either[apart] = pointer
            if {one, other} <= self.padded_rooms and distance % self.inner == 0:
                self.padded_rooms.add(pointer)
        for i in stored:
            known, apart = self.homes[id(defaults[i])], self._apart(values[i], defaults[i])
            self.homes[id(parts[i])] = known._replace(pointer=either[apart])

    def _stays_stored(self, head: Value, place: int) -> bool:
        """Whether both of a conditional's numbers lie in memory: the result lies at either place.

        Those that it gives then are entries of maps.
        """
        value, default = head.args[2][place], head.args[3][place]
        if self.inner == 1 or value.op != "part" or id(default) not in self.homes:
            return False
        source, place = value.args
        return source.op == "map" or (source.op == "if" and self._stays_stored(source, place))

    def _apart(self, value: Value, default: Value) -> tuple[str, str, int]:
        """The memories in which two values lie, and how much further in it the first one does."""
        new, old = self.homes[id(value)], self.homes[id(default)]
        return new.pointer, old.pointer, new.offset - old.offset

    def _write_repeat(self, head: Value, width: int) -> None:
        length, inside, starts, held, ends = head.args
        start = self.text.label
        first = [self.use(v, width) for v in starts]
        with self.text.loop(length):
            at = len(self.text.lines)
            names = ["%" + self.text.fresh("h") for _ in held]
            for value, text in zip(held, names, strict=True):
                self.name(value, text, width)
            with self.text.scope():
                self.write(inside, width)
                last = [self.use(v, width) for v in ends]
            phis, end = zip(held, names, first, last, strict=True), self.text.label
            self.text.lines[at:at] = [
                f"  {name} = phi {vector(v.kind, width)} [ {a}, %{start} ], [ {b}, %{end} ]"
                for v, name, a, b in phis
            ]
        for part, text in zip(_parts_of(head), last, strict=True):
            self.name(part, text, width)

    def _write_map(self, head: Value) -> None:
        """A loop over entries; where a vector holds one simulation alone, over many at once."""
        length, inside, taken, values = head.args
        lanes = self.inner if self.width == 1 else self.width
        step = self.inner if self.width == 1 else 1
        padded = self.padded(length)
        rows = [value for value in taken if value in self.needed]
        sources = [self._row(value.args[0].args[0][value.args[1]], padded) for value in rows]
        parts = _parts_of(head)
        targets = self._targets(head, parts, padded)
        with self.text.loop(length, step=step) as counter, self.text.scope():
            entry = {
                stride: self.text.assign(f"mul i64 {counter}, {stride * self.width}")
                for stride in sorted({1, *(stride for _, stride in sources)})
            }
            for value, (pointer, stride) in zip(rows, sources, strict=True):
                there = self.text.address(pointer, value.kind, entry[stride])
                self.name(value, self.text.load(there, value.kind, lanes), lanes)
            wanted = [(values[k], target) for k, target in targets.items()]
            self._write_entry(inside, wanted, entry[1], lanes)
        for k, target in targets.items():
            for j, part in enumerate(parts[k * length : (k + 1) * length]):
                self.homes[id(part)] = target._replace(offset=target.offset + j)

    def _targets(self, head: Value, parts: list[Value], padded: int) -> dict[int, Place]:
        """Where the needed values go: one memory for each kind, in which they lie regularly."""
        length, _, _, values = head.args
        needed: dict[Kind, list[int]] = {}
        for k, value in enumerate(values):
            if any(part in self.needed for part in parts[k * length : (k + 1) * length]):
                needed.setdefault(value.kind, []).append(k)
        targets: dict[int, Place] = {}
        for kind, wanted in needed.items():
            pointer = self.room(kind, len(wanted) * padded)
            self.padded_rooms.add(pointer)
            targets |= {k: Place(pointer, i * padded) for i, k in enumerate(wanted)}
        return targets

    def _write_entry(
        self, inside: Block, wanted: Sequence[tuple[Value, Place]], entry: str, lanes: int
    ) -> None:
        """One entry of a map: what is known is stored at once, and takes no register any more."""
        places: dict[int, list[Place]] = {}
        for value, place in wanted:
            places.setdefault(id(value), []).append(place)

        def store(value: Value) -> None:
            for place in places.pop(id(value), []):
                row = self.text.address(place.pointer, value.kind, place.offset * self.width)
                at = self.text.address(row, value.kind, entry)
                self.text.store(self.use(value, lanes), at, value.kind, lanes)

        self.write(inside, lanes, store)
        for value, _ in wanted:
            store(value)

    def _row(self, row: Sequence[Value], padded: int) -> tuple[str, int]:
        """Address of the first of some values, and how many vectors further each next one lies.

        Values that lie irregularly are copied.
        """
        kind, regular = row[0].kind, self.regular_row(row)
        if regular is not None:
            (pointer, offset), stride = regular
            return self.text.address(pointer, kind, offset * self.width), stride
        pointer, known = self.room(kind, padded), all(value.constant is not None for value in row)
        # Constants are written once, where memory is allocated.
        with self.text.writing_at_entry() if known else contextlib.nullcontext():
            for i, value in enumerate(row):
                at = self.text.address(pointer, kind, i * self.width)
                self.text.store(self.use(value), at, kind, self.width)
        return pointer, 1

    def regular_row(self, row: Sequence[Value]) -> tuple[Place, int] | None:
        """The first of some values that lie regularly, and how many vectors further each next."""
        places = [self.homes.get(id(value)) for value in row]
        first = places[0]
        if first is None or (self.width == 1 and first.pointer not in self.padded_rooms):
            return None
        second = places[1] if len(places) > 1 else None
        stride = 1 if second is None else second.offset - first.offset
        regular = all(
            place == Place(first.pointer, first.offset + i * stride)
            for i, place in enumerate(places)
        )
        # Many entries are one vector only where they lie side by side, from a whole one on.
        whole = self.width > 1 or (stride == 1 and first.offset % self.inner == 0)
        return (first, stride) if regular and whole else None


def _parts_of(head: Value) -> list[Value]:
    """A region's results: they follow it in its block."""
    block = head.block.values
    after = block[block.index(head) + 1 :]
    return list(itertools.takewhile(lambda v: v.op == "part" and v.args[0] is head, after))
