"""Lane scheduler: lanes take simulations, read rows, give outputs and record one by one."""

from collections.abc import Callable
from typing import NamedTuple

from jaxbiped.compiler.codegen._llvm_function import FunctionBuilder
from jaxbiped.compiler.ir._graph import Kind

FIELDS = (
    "count",
    "queue",
    "stop",
    "inputs",
    "outputs",
    "records",
    "record_counts",
    "record_room",
    "schedule",
    "schedule_length",
    "streams",
    "stream_lengths",
    "stream_stride",
    "input_places",
    "input_steps",
)
"""What a kernel's entry takes: 64-bit numbers one behind the other, addresses among them. Number k
of simulation i is input `input_places[k] + i input_steps[k]`, and output i n + k of n numbers."""
_NUMBERS = ("count", "record_room", "schedule_length", "stream_stride")


class Sizes(NamedTuple):
    """How many numbers a simulation takes, gives, has in a record, and in a row of its stream."""

    inputs: int
    outputs: int
    recorded: int
    row: int


class Rooms(NamedTuple):
    """Where in memory the lanes' inputs, outputs, records, stream rows and next times are."""

    taken: str
    given: str
    noted: str
    row: str
    next_time: str


class Stretch(NamedTuple):
    """Numbers in memory, from the `first` one behind `pointer` on, each `step` further."""

    pointer: str
    first: str
    step: int


_MARKS = {"done": 1, "live": 1, "fresh": 0, "wants": 0}
"""Marks of each lane, and what they are at first."""


class LaneScheduler:
    """Writes what is done for one lane at a time.

    Attributes:
        text: where to.
        width: number of lanes.
        sizes, rooms: see there.
        scheduled: whether records follow a schedule.
        field: names of the `FIELDS`.
        bits: where each lane's simulation (`index`, −1 for none), its records (`counts`), the
            rows that it has read (`rows`) and its marks (`done`, `live`, `fresh`, `wants`) are.
    """

    def __init__(self, text: FunctionBuilder, width: int, sizes: Sizes, *, scheduled: bool) -> None:
        self.text, self.width, self.sizes, self.scheduled = text, width, sizes, scheduled
        self.field: dict[str, str] = {}
        for place, name in enumerate(FIELDS):
            at = text.assign(f"getelementptr i64, ptr %fields, i64 {place}")
            kind = "i64" if name in _NUMBERS else "ptr"
            self.field[name] = text.assign(f"load {kind}, ptr {at}, align 8")
        many = [max(size, 1) * width for size in sizes]
        self.rooms = Rooms(*[text.room(Kind.F64, size) for size in (*many, width)])
        self.bits = {name: text.room(Kind.I64, width) for name in ("index", "counts", "rows")}
        self.bits |= {name: text.room(Kind.BOOL, width) for name in _MARKS}
        for lane in range(width):
            text.line(f"store i64 -1, ptr {text.address(self.bits['index'], Kind.I64, lane)}")
            for name, bit in _MARKS.items():
                text.line(f"store i8 {bit}, ptr {text.address(self.bits[name], Kind.BOOL, lane)}")

    def exchange(self, lane: str) -> None:
        """A lane gives its outputs and takes the next simulation, or rests where there is none."""
        t = self.text
        index = self._get(self.bits["index"], lane)
        with t.where(t.assign(f"icmp sge i64 {index}, 0")):
            self._give_outputs(lane, index)
            if self.sizes.recorded:
                count = self._get(self.bits["counts"], lane)
                self._put(count, self.field["record_counts"], index)
        queue = self.field["queue"]
        following = t.assign(f"atomicrmw add ptr {queue}, i64 1 monotonic")
        more = t.assign(f"icmp slt i64 {following}, {self.field['count']}")
        taken = t.assign(f"select i1 {more}, i64 {following}, i64 -1")
        self._put(taken, self.bits["index"], lane)
        for name in ("live", "fresh"):
            t.store(more, t.address(self.bits[name], Kind.BOOL, lane), Kind.BOOL, 1)
        with t.where(more):
            self._put("0", self.bits["counts"], lane)
            if self.sizes.row:
                self._put("0", self.bits["rows"], lane)
            if self.scheduled:
                self._schedule(lane, "0")
            self._take_inputs(lane, following)

    def read(self, lane: str) -> None:
        """A lane reads the next row of its stream, behind the last one that one again."""
        t = self.text
        place = self._get(self.bits["rows"], lane)
        index = self._get(self.bits["index"], lane)
        first = t.assign(f"inttoptr i64 {self._get(self.field['streams'], index)} to ptr")
        row = t.assign(f"mul i64 {place}, {self.field['stream_stride']}")
        target = Stretch(self.rooms.row, lane, self.width)
        self._copy_numbers(self.sizes.row, Stretch(first, row, 1), target)
        following = t.assign(f"add i64 {place}, 1")
        length = self._get(self.field["stream_lengths"], index)
        more = t.assign(f"icmp slt i64 {following}, {length}")
        chosen = t.assign(f"select i1 {more}, i64 {following}, i64 {place}")
        self._put(chosen, self.bits["rows"], lane)

    def _get(self, array: str, place: str) -> str:
        """A whole number of an array."""
        return self.text.assign(f"load i64, ptr {self.text.address(array, Kind.I64, place)}")

    def _put(self, number: str, array: str, place: str) -> None:
        self.text.line(f"store i64 {number}, ptr {self.text.address(array, Kind.I64, place)}")

    def _copy_numbers(self, many: int, source: Stretch, target: Stretch) -> None:
        """Copies numbers one after the other, each written out."""
        for k in range(many):
            number = self.text.assign(f"load double, ptr {self._entry(source, k)}")
            self.text.line(f"store double {number}, ptr {self._entry(target, k)}")

    def _entry(self, numbers: Stretch, k: int) -> str:
        place = self.text.assign(f"add i64 {numbers.first}, {k * numbers.step}")
        return self.text.address(numbers.pointer, Kind.F64, place)

    def _take_inputs(self, lane: str, index: str) -> None:
        """Copies a simulation's inputs to its lane."""
        t = self.text
        if not self.sizes.inputs:
            return
        with t.loop(self.sizes.inputs, index="k") as k:
            moved = t.assign(f"mul i64 {self._get(self.field['input_steps'], k)}, {index}")
            there = t.assign(f"add i64 {self._get(self.field['input_places'], k)}, {moved}")
            at = t.address(self.field["inputs"], Kind.F64, there)
            number = t.assign(f"load double, ptr {at}")
            t.line(f"store double {number}, ptr {self._own(self.rooms.taken, k, lane)}")

    def _give_outputs(self, lane: str, index: str) -> None:
        """Copies a lane's outputs to its simulation's."""
        t = self.text
        if not self.sizes.outputs:
            return
        row = t.assign(f"mul i64 {index}, {self.sizes.outputs}")
        with t.loop(self.sizes.outputs, index="k") as k:
            number = t.assign(f"load double, ptr {self._own(self.rooms.given, k, lane)}")
            at = t.address(self.field["outputs"], Kind.F64, t.assign(f"add i64 {row}, {k}"))
            t.line(f"store double {number}, ptr {at}")

    def _own(self, room: str, k: str, lane: str) -> str:
        """Where the k-th number of a lane is in a room of all lanes."""
        row = self.text.assign(f"mul i64 {k}, {self.width}")
        return self.text.address(room, Kind.F64, self.text.assign(f"add i64 {row}, {lane}"))

    def _schedule(self, lane: str, place: str) -> None:
        """Looks up a lane's next time, infinity behind the last one."""
        t = self.text
        at = t.address(self.rooms.next_time, Kind.F64, lane)
        t.line(f"store double 0x7FF0000000000000, ptr {at}")
        with t.where(t.assign(f"icmp slt i64 {place}, {self.field['schedule_length']}")):
            there = t.address(self.field["schedule"], Kind.F64, place)
            t.line(f"store double {t.assign(f'load double, ptr {there}')}, ptr {at}")

    def visit_where(self, where: str, visit: Callable[[str], None]) -> None:
        """Visits the lanes in which a mask in memory holds."""
        t = self.text
        with t.loop(self.width, index="lane") as lane:
            at = t.address(self.bits[where], Kind.BOOL, lane)
            with t.where(t.load(at, Kind.BOOL, 1)):
                visit(lane)

    def note(self, lane: str) -> None:
        """Appends a lane's record to its simulation's, where there is room."""
        t = self.text
        count = self._get(self.bits["counts"], lane)
        with t.where(t.assign(f"icmp slt i64 {count}, {self.field['record_room']}")):
            index = self._get(self.bits["index"], lane)
            row = t.assign(f"mul i64 {index}, {self.field['record_room']}")
            row = t.assign(f"add i64 {row}, {count}")
            row = t.assign(f"mul i64 {row}, {self.sizes.recorded}")
            source = Stretch(self.rooms.noted, lane, self.width)
            self._copy_numbers(self.sizes.recorded, source, Stretch(self.field["records"], row, 1))
        more = t.assign(f"add i64 {count}, 1")
        self._put(more, self.bits["counts"], lane)
        if self.scheduled:
            self._schedule(lane, more)
