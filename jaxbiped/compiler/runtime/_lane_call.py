"""Lane call: simulations that a compiled program of XLA has run on the host, and their records.

These wait on the host until somebody asks for them: another program may read them. They lie in
memory that is used again: the first touch of a page takes longer than what is written there.
"""

import collections
import enum
import math
import threading
import weakref
from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple, Optional, TypeAlias

import numpy as np

from jaxbiped._types import Numbers
from jaxbiped.caching._caches import half_of_cache_bytes, register_cache
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._machine_code import default_threads
from jaxbiped.compiler.runtime._processors import InputTable
from jaxbiped.compiler.runtime._program import Recorded

BLOCK = 512
"""Simulations that record, or read records, at once: all together would take much memory."""


class BufferPool:
    """Gives arrays, and takes their memory back when nobody refers to them or to views of them."""

    def __init__(self, most: Callable[[], int]) -> None:
        """Keeps at most `most` bytes that nobody uses; what waits longest goes first."""
        self._most = most
        self._free: dict[int, np.ndarray] = {}

    @property
    def kept(self) -> int:
        """Bytes that wait to be used again."""
        return sum(owner.nbytes for owner in list(self._free.values()))

    def clear(self) -> None:
        """Keeps nothing of what nobody uses now."""
        self._free.clear()

    def array(self, shape: tuple[int, ...]) -> np.ndarray:
        """Of 64-bit floating-point numbers, whatever was there before."""
        size = math.prod(shape)
        # Sizes differ a little from call to call: rounded up, they meet again.
        unit = 1 << max(size.bit_length() - 3, 0)
        capacity = max(-(-size // unit), 1) * unit
        fitting = [key for key, owner in list(self._free.items()) if len(owner) == capacity]
        taken = (self._free.pop(key, None) for key in reversed(fitting))
        owner = next((each for each in taken if each is not None), None)
        if owner is None:
            owner = np.empty(capacity)
        # Views of an array refer to its owner: this one owns nothing, so they refer to it.
        whole = np.frombuffer(owner.data)
        weakref.finalize(whole, self._take_back, owner).atexit = False
        return whole[:size].reshape(shape)

    def _take_back(self, owner: np.ndarray) -> None:
        # Called wherever garbage is found, by any thread: nothing here may wait for a lock.
        most = self._most()
        if owner.nbytes > most:
            return
        self._free[id(owner)] = owner
        for key in list(self._free):
            if self.kept <= most:
                return
            self._free.pop(key, None)


Tables: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of n simulations: outputs (n, numbers), records (n, room, numbers), and how many these are."""
_Key: TypeAlias = tuple[Hashable, bytes]
"""A program and the bytes of one simulation's inputs."""


class RecordCache:
    """What simulations recorded, by program and inputs, as long as there is room for it.

    A search runs many simulations and needs the records of two of them, known only at its end:
    they need not travel through it. Nothing depends on what is held: what is missing is run again.
    """

    def __init__(self, most: Callable[[], int]) -> None:
        """Holds `most` bytes, inputs included; beyond them what came first goes first."""
        self._most, self._size = most, 0
        self._records: collections.OrderedDict[_Key, np.ndarray] = collections.OrderedDict()
        self._lock = threading.Lock()

    @property
    def kept(self) -> int:
        """Bytes of what is held."""
        return self._size

    def clear(self) -> None:
        """Holds nothing any more."""
        with self._lock:
            self._records.clear()
            self._size = 0

    def run(
        self, program: Hashable, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Outputs of what `run` finds for inputs (n, numbers), and its records, now known."""
        every, found = [], []
        for first in range(0, len(inputs), BLOCK):
            outputs, records, counts = run(inputs[first : first + BLOCK])
            every.append(outputs)
            # Where they fill most of their room, that stays; else it would be held for little.
            filled = 2 * np.sum(counts) >= records.shape[0] * records.shape[1]
            own = [each[:n] for each, n in zip(records, counts, strict=True)]
            found += own if filled else [each.copy() for each in own]
        with self._lock:
            for row, each in zip(inputs, found, strict=True):
                key = program, row.tobytes()
                self._drop(key)
                self._records[key] = each
                self._size += _bytes_of(key, each)
            while self._size > self._most():
                self._drop(next(iter(self._records)))
        return np.concatenate(every), found

    def records(
        self, program: Hashable, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]
    ) -> list[np.ndarray]:
        """Records of each simulation (records, numbers); those that are not known `run` finds."""
        keys = [(program, row.tobytes()) for row in inputs]
        with self._lock:
            known = {key: self._records[key] for key in keys if key in self._records}
        missing = [i for i, key in enumerate(keys) if key not in known]
        if missing:
            _, found = self.run(program, inputs[missing], run)
            known |= {keys[i]: each for i, each in zip(missing, found, strict=True)}
        return [known[key] for key in keys]

    def forget(self, program: Hashable, inputs: np.ndarray) -> None:
        """Holds the records of these no longer."""
        with self._lock:
            for row in inputs:
                self._drop((program, row.tobytes()))

    def _drop(self, key: _Key) -> None:
        records = self._records.pop(key, None)
        self._size -= 0 if records is None else _bytes_of(key, records)


def _bytes_of(key: _Key, records: np.ndarray) -> int:
    return len(key[1]) + records.nbytes


_RECORDS, _BUFFERS = RecordCache(half_of_cache_bytes), BufferPool(half_of_cache_bytes)
register_cache(
    "records of simulations", lambda: _RECORDS.kept, half_of_cache_bytes, _RECORDS.clear, "bytes"
)
register_cache(
    "buffers for records", lambda: _BUFFERS.kept, half_of_cache_bytes, _BUFFERS.clear, "bytes"
)


class Part(enum.Enum):
    """Which part of what simulations give is wanted."""

    ALL = "outputs and records"
    OUTPUTS = "outputs, while records are kept on the host"
    COLUMNS = "records that were kept on the host"


class Schedule:
    """Times of records, the same for every simulation. Compared by identity."""

    def __init__(self, times: np.ndarray) -> None:
        self.times = np.ascontiguousarray(times, dtype=np.float64)


class LaneRun(NamedTuple):
    """How simulations are run. Hashable.

    Their numbers are their own inputs and behind them the numbers of what they read.

    Attributes:
        compiled: the program.
        room: for how many records there is room.
        quick: whether a single simulation is over before a user could interrupt.
        once: whether records that are kept on the host are read only once.
        reads: how those were run whose records are its stream, if it reads such.
        schedule: of its records, one at each time, where it has such.
    """

    compiled: CompiledProgram
    room: int = 0
    quick: bool = False
    once: bool = False
    reads: Optional["LaneRun"] = None
    schedule: Schedule | None = None

    def everything(self, numbers: np.ndarray, stream: Numbers | None = None) -> list[np.ndarray]:
        """Outputs (n, o) of simulations with these numbers (n, k), and what they recorded."""
        width = self._width(len(numbers))
        size = len(numbers) if self.reads is None else BLOCK
        parts = [slice(k, k + size) for k in range(0, max(1, len(numbers)), max(1, size))]
        found = []
        for part in parts:
            own, rows = self._own_and_rows(numbers[part])
            rows = rows if stream is None else list(np.asarray(stream))
            outputs, recorded = self._run(own, rows, self.room, width)
            found.append([outputs, *(recorded or ())])
        columns = zip(*found, strict=True)
        return [each[0] if len(each) == 1 else np.concatenate(each) for each in columns]

    def outputs(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Outputs alone; their records are then known."""
        return [_RECORDS.run(self, numbers, self._recording(len(numbers)))[0]]

    def rows(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Records of each simulation (records, numbers), or zeros where it made none."""
        known = _RECORDS.records(self, numbers, self._recording(len(numbers)))
        if self.once:
            _RECORDS.forget(self, numbers)
        return [each if len(each) else np.zeros((1, each.shape[1])) for each in known]

    def columns(self, numbers: np.ndarray, first: np.ndarray) -> list[np.ndarray]:
        """The first k numbers in a record, each as an array (n, 1 + room), NaN beyond the last.

        Before those recorded comes that of `first`, shape (n, k).
        """
        known = _RECORDS.records(self, numbers, self._recording(len(numbers)))
        found = [np.full((len(known), 1 + self.room), np.nan) for _ in first.T]
        for i, records in enumerate(known):
            for column, start, values in zip(found, first[i], records.T, strict=False):
                column[i, 0], column[i, 1 : 1 + len(values)] = start, values
        return found

    def _recording(self, count: int) -> Callable[[np.ndarray], Tables]:
        """Runs those of `count` simulations that nobody ran yet."""
        # Also where these are few: another width would have to be compiled.
        width = self._width(count)

        def run(table: np.ndarray) -> Tables:
            own, rows = self._own_and_rows(table)
            # At most one record for each row that it reads.
            room = self.room if rows is None else min(self.room, max(map(len, rows)))
            outputs, recorded = self._run(own, rows, room, width, _BUFFERS.array)
            assert recorded is not None
            return outputs, *recorded

        return run

    def _run(
        self,
        own: np.ndarray,
        rows: Sequence[np.ndarray] | None,
        room: int,
        width: int,
        memory: Callable[[tuple[int, ...]], np.ndarray] = np.zeros,
    ) -> tuple[np.ndarray, Recorded | None]:
        return self.compiled.run_table(
            InputTable.of_rows(own),
            schedule=None if self.schedule is None else self.schedule.times,
            stream=rows,
            room=room,
            memory=memory,
            quick=self.quick and len(own) == 1,
            width=width,
        )

    def _own_and_rows(self, table: np.ndarray) -> tuple[np.ndarray, list[np.ndarray] | None]:
        """Own inputs of simulations, and the rows that others recorded for them."""
        own, others = np.split(table, [self.compiled.kernel.size], axis=1)
        return own, None if self.reads is None else self.reads.rows(others)

    def _width(self, count: int) -> int:
        return self.compiled.width(count, default_threads())


class LaneCall(NamedTuple):
    """What a compiled program calls: so many simulations at once, and what of them is wanted."""

    simulations: int
    how: LaneRun
    wants: Part

    def __call__(self, *given: Numbers) -> list[np.ndarray]:
        numbers, *rest = map(np.asarray, given)
        if self.wants is Part.OUTPUTS:
            return self.how.outputs(numbers)
        if self.wants is Part.COLUMNS:
            return self.how.columns(numbers, *rest)
        return self.how.everything(numbers, *rest)

    def __fingerprint__(self) -> object:
        return tuple(self)

    def ready(self) -> bool:
        """Whether it, and what it reads if that was given up, runs without compiling."""
        reads = self.how.reads
        again = reads is None or self._replace(how=reads).ready()
        return again and self.how.compiled.runs_at_once(self.simulations)
