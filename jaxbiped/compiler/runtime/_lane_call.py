"""Lane call: simulations that a compiled program of XLA has run on the host."""

import enum
from collections.abc import Callable, Sequence
from typing import NamedTuple, Optional

import numpy as np

from jaxbiped._types import Numbers
from jaxbiped.caching._caches import half_of_cache_bytes, register_bytes
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._host_cpu import default_threads
from jaxbiped.compiler.runtime._program import Recorded
from jaxbiped.compiler.runtime._record_cache import BLOCK, BufferPool, RecordCache, Tables

_RECORDS = RecordCache(most=half_of_cache_bytes)
_BUFFERS = BufferPool(most=half_of_cache_bytes)
register_bytes("records of simulations", _RECORDS)
register_bytes("buffers for records", _BUFFERS)


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
        schedule: of its records, where it has one; its length is then their `room`.
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
            own, rows = self._own_and_rows(numbers[part].T)
            if stream is not None:
                rows = list(np.asarray(stream))
            outputs, recorded = self._run(own, rows, self.room, width)
            found.append([outputs.T, *(recorded or ())])
        return [np.concatenate(each) for each in zip(*found, strict=True)]

    def outputs(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Outputs alone; their records are then known."""
        return [_RECORDS.run(self, numbers.T, self._recording(len(numbers)))[0].T]

    def rows(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Records of each simulation (records, numbers), or zeros where it made none."""
        known = _RECORDS.records(self, numbers.T, self._recording(len(numbers)))
        if self.once:
            _RECORDS.forget(self, numbers.T)
        return [each if len(each) else np.zeros((1, each.shape[1])) for each in known]

    def columns(self, numbers: np.ndarray, first: np.ndarray) -> list[np.ndarray]:
        """The first k numbers in a record, each as an array (n, 1 + room), NaN beyond the last.

        Before those recorded comes that of `first`, shape (n, k).
        """
        known = _RECORDS.records(self, numbers.T, self._recording(len(numbers)))
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
        times = None if self.schedule is None else self.schedule.times
        return self.compiled.run_table(
            own,
            schedule=times,
            stream=rows,
            room=room if times is None else len(times),
            memory=memory,
            quick=self.quick and own.shape[1] == 1,
            width=width,
        )

    def _own_and_rows(self, table: np.ndarray) -> tuple[np.ndarray, list[np.ndarray] | None]:
        """Own inputs of simulations, and the rows that others recorded for them."""
        own, others = np.split(table, [self.compiled.size])
        return own, None if self.reads is None else self.reads.rows(others.T)

    def _width(self, count: int) -> int:
        return self.compiled.width(count, default_threads())


class LaneCall(NamedTuple):
    """What a compiled program calls: so many simulations at once, and what of them is wanted."""

    simulations: int
    how: LaneRun
    wants: Part

    def __call__(self, numbers: Numbers, *rest: Numbers) -> list[np.ndarray]:
        given = [np.asarray(each) for each in (numbers, *rest)]
        if self.wants is Part.OUTPUTS:
            return self.how.outputs(*given)
        return (self.how.everything if self.wants is Part.ALL else self.how.columns)(*given)

    def __fingerprint__(self) -> object:
        return tuple(self)

    def ready(self) -> bool:
        """Whether it runs without tracing or compiling."""
        wants_code = self.wants is not Part.COLUMNS
        return not wants_code or self.how.compiled.runs_at_once(self.simulations)
