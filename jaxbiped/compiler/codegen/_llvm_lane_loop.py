"""Lane kernel: the loop that keeps every lane busy, as LLVM's text.

A lane whose simulation is over takes the next one at once, so that a long simulation does not hold
up its neighbours.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from jaxbiped.compiler.codegen._kernel_target import (
    WARP_ANY,
    KernelTarget,
    begin_flushing,
    end_flushing,
)
from jaxbiped.compiler.codegen._lane_scheduler import LaneScheduler, Sizes
from jaxbiped.compiler.codegen._llvm_from_graph import GraphWriter, Place
from jaxbiped.compiler.codegen._llvm_function import BYTES, WEIGHTS, vector
from jaxbiped.compiler.ir._graph import Block, Kind, Value
from jaxbiped.compiler.ir._liveness import Liveness
from jaxbiped.compiler.ir._primitives import Array
from jaxbiped.compiler.runtime._program import Graph

ENTRY = "jaxbiped_run"


def kernel_text(graph: Graph, target: KernelTarget) -> str:
    """LLVM's text of a graph's loop over simulations, many at once.

    Its entry takes the address of `FIELDS`. Simulations are taken from the queue, a counter that
    every thread shares, until there are none left or `stop` is not zero.
    """
    return _Kernel(graph, target).text()


class _Kernel:
    def __init__(self, graph: Graph, target: KernelTarget) -> None:
        self.graph, self.target, self.width = graph, target, target.width
        self.needed = Liveness(graph.results())
        self.writer = GraphWriter(target, self.needed)
        self.t = self.writer.text
        sizes = Sizes(len(graph.inputs), len(graph.outputs), len(graph.recorded), len(graph.row))
        self.lanes = LaneScheduler(self.t, self.width, sizes, scheduled=graph.scheduled)
        self.kept: list[tuple[Value, Place]] = []

    def text(self) -> str:
        t = self.t
        found = begin_flushing(t, self.target.architecture)
        self._rooms()
        t.line("br label %refill")
        self._refill()
        any_done = self._attempt()
        self._records()
        t.line(f"br i1 {any_done}, label %refill, label %attempt")
        t.begin("leave")
        end_flushing(t, self.target.architecture, found)
        t.line("ret void")
        entry = f"define {self.target.convention}void @{ENTRY}(ptr noalias %fields) {{"
        head = [*self.target.declarations(t.declarations), entry, "entry:"]
        return "\n".join([*head, *t.allocations, *t.lines, "}", WEIGHTS]) + "\n" + self.target.rest

    def _rooms(self) -> None:
        """Memory for what outlives an attempt."""
        w, graph, rooms = self.writer, self.graph, self.lanes.rooms
        for offset, value in enumerate(graph.inputs):
            w.homes[id(value)] = Place(rooms.taken, offset)
        for offset, value in enumerate(graph.row):
            w.homes[id(value)] = Place(rooms.row, offset)
        w.homes[id(graph.next_time)] = Place(rooms.next_time, 0)
        blocks = (graph.begin, graph.body, graph.end, graph.notes)
        used = self._used_in((*graph.results(), *blocks))
        rooms_of: dict[Kind, list[Value]] = {}
        for value in graph.prepare.values:
            stored = value in self.needed and id(value) not in self.needed.absorbed
            if stored and id(value) in used and value.op not in ("const", "input", "if"):
                rooms_of.setdefault(value.kind, []).append(value)
        for kind, values in rooms_of.items():
            pointer = self._zeroed_room(kind, len(values))
            self.kept += [(value, Place(pointer, i)) for i, value in enumerate(values)]
        for array in graph.carried:
            self._carry_room(array)

    def _used_in(self, args: Iterable[object]) -> set[int]:
        """Ids of arguments of operations, and of all that blocks among them take from outside."""
        used: set[int] = set()
        for arg in args:
            if isinstance(arg, Value):
                used.add(id(arg))
            elif isinstance(arg, Block):
                for value in arg.values:
                    used |= self._used_in(value.args) if value in self.needed else set()
            elif isinstance(arg, list | tuple):
                used |= self._used_in(arg)
        return used

    def _carry_room(self, array: Array) -> None:
        """Memory for what is carried: along its first axis one behind the other, for maps."""
        if not array.size:
            return
        w = self.writer
        kind = next(iter(array.ravel())).kind
        flat = _rows(array)
        padded = w.padded(flat.shape[-1]) if array.ndim else 1
        pointer = self._zeroed_room(kind, padded * len(flat))
        if array.ndim:
            w.padded_rooms.add(pointer)
        for j, row in enumerate(flat):
            for k, value in enumerate(row):
                w.homes[id(value)] = Place(pointer, j * padded + k)

    def _zeroed_room(self, kind: Kind, count: int) -> str:
        """Memory with zeros: the first outputs are made of it, before any simulation has begun.

        They are given to nobody, but LLVM takes a branch on memory without content for a proof
        that the kernel is never run.
        """
        pointer, size = self.writer.room(kind, count), count * self.width * BYTES[kind]
        self.t.declarations.add("declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)")
        self.t.line(f"call void @llvm.memset.p0.i64(ptr {pointer}, i8 0, i64 {size}, i1 false)")
        return pointer

    def _refill(self) -> None:
        """Lanes that are done give their outputs and take the next simulations."""
        w, t, graph, lanes = self.writer, self.t, self.graph, self.lanes
        t.begin("refill")
        self._keep(True)
        with t.scope():
            w.write(graph.end)
            for offset, value in enumerate(graph.outputs):
                self._store(w.use(value), value.kind, Place(lanes.rooms.given, offset))
        none = t.splat_constant("0", Kind.BOOL, self.width)
        t.store(none, lanes.bits["fresh"], Kind.BOOL, self.width)
        lanes.visit_where("done", lanes.exchange)
        with t.scope():
            live = self._any(self._mark("live"))
            t.line(f"br i1 {live}, label %prepare, label %leave")
        t.begin("prepare")
        self._keep(False)
        with t.scope():
            w.write(graph.prepare)
            for value, place in self.kept:
                self._store(w.use(value), value.kind, place)
        self._keep(True)
        with t.scope():
            w.write(graph.begin)
            self._begin()
        t.line("br label %attempt")

    def _keep(self, kept: bool) -> None:
        """Whether what depends on the inputs alone is taken from memory, or being computed."""
        for value, place in self.kept:
            if kept:
                self.writer.homes[id(value)] = place
            else:
                del self.writer.homes[id(value)]

    def _begin(self) -> None:
        """What is carried at first, in the lanes that took a new simulation."""
        w, t, graph = self.writer, self.t, self.graph
        fresh = self._mark("fresh")
        for new, old in zip(graph.first, graph.carried, strict=True):
            for a, b in zip(new.ravel(), old.ravel(), strict=True):
                of = vector(b.kind, self.width)
                mask = f"{vector(Kind.BOOL, self.width)} {fresh}"
                chosen = t.assign(f"select {mask}, {of} {w.use(a)}, {of} {w.use(b)}")
                self._store(chosen, b.kind, w.homes[id(b)])

    def _attempt(self) -> str:
        """An attempt in every lane; whether any lane is done."""
        w, t, graph, lanes = self.writer, self.t, self.graph, self.lanes
        t.begin("attempt")
        stop = t.assign(f"load volatile i64, ptr {lanes.field['stop']}")
        going = t.assign(f"icmp eq i64 {stop}, 0")
        if self.target.votes:
            # No thread of a warp may leave before the others.
            going = self._any(going)
        t.line(f"br i1 {going}, label %step, label %leave")
        t.begin("step")
        if graph.row:
            lanes.visit_where("live", lanes.read)
        with t.scope():
            w.write(graph.body)
            found = [
                each
                for new, old in zip(graph.following, graph.carried, strict=True)
                for each in self._following(new, old)
            ]
            done = w.use(graph.done)
            for text, kind, place, width in found:
                self._store(text, kind, place, width)
            done = self._live(done)
            t.store(done, lanes.bits["done"], Kind.BOOL, self.width)
            return self._any(done)

    def _following(self, new: Array, old: Array) -> Iterator[tuple[str, Kind, Place, int]]:
        """What is to be carried, of which kind, where to and of which width."""
        w, step = self.writer, self.writer.inner
        for values, kept in zip(_rows(new), _rows(old), strict=True) if old.size else ():
            whole = self.width == 1 and old.ndim and 1 < step <= old.shape[0]
            regular = w.regular_row(values) if whole else None
            if regular is None:
                changed = ((a, b) for a, b in zip(values, kept, strict=True) if a is not b)
                yield from ((w.use(a), b.kind, w.homes[id(b)], self.width) for a, b in changed)
                continue
            (pointer, offset), first, kind = regular[0], w.homes[id(kept[0])], kept[0].kind
            for i in range(0, w.padded(len(kept)), step):
                found = self.t.load(self.t.address(pointer, kind, offset + i), kind, step)
                yield found, kind, Place(first.pointer, first.offset + i), step

    def _records(self) -> None:
        """Records, once or as long as any lane has another."""
        w, t, graph, lanes = self.writer, self.t, self.graph, self.lanes
        if graph.recording is None:
            return
        t.line("br label %record")
        t.begin("record")
        with t.scope():
            w.write(graph.notes)
            wants = self._live(w.use(graph.recording))
            t.store(wants, lanes.bits["wants"], Kind.BOOL, self.width)
            t.line(f"br i1 {self._any(wants)}, label %note, label %recorded")
            t.begin("note")
            for place, value in enumerate(graph.recorded):
                self._store(w.use(value), value.kind, Place(lanes.rooms.noted, place))
        lanes.visit_where("wants", lanes.note)
        t.line(f"br label %{'record' if graph.scheduled else 'recorded'}")
        t.begin("recorded")

    def _any(self, mask: str) -> str:
        """Whether a mask holds in any of the simulations that go on together."""
        mask = self.t.any_lane(mask, self.width)
        if not self.target.votes:
            return mask
        self.t.declarations.add(f"declare i1 @{WARP_ANY}(i1)")
        return self.t.assign(f"call i1 @{WARP_ANY}(i1 {mask})")

    def _mark(self, name: str) -> str:
        return self.t.load(self.lanes.bits[name], Kind.BOOL, self.width)

    def _live(self, mask: str) -> str:
        return self.t.assign(f"and {vector(Kind.BOOL, self.width)} {mask}, {self._mark('live')}")

    def _store(self, text: str, kind: Kind, place: Place, width: int | None = None) -> None:
        at = self.t.address(place.pointer, kind, place.offset * self.width)
        self.t.store(text, at, kind, self.width if width is None else width)


def _rows(array: Array) -> Array:
    """Its numbers with what lies side by side in memory in rows: the first axis as the last one."""
    rows = np.moveaxis(array, 0, -1) if array.ndim else array.reshape(1)
    return rows.reshape(-1, rows.shape[-1])
