"""Recorders: programs whose records stay on the host, where another one may read them."""

from collections.abc import Callable
from typing import NamedTuple, Optional

import numpy as np

from jaxbiped.caching._caches import half_of_cache_bytes, register_bytes
from jaxbiped.compiler.runtime._buffer_pool import BufferPool
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._record_cache import RecordCache, Tables
from jaxbiped.compiler.runtime._threads import default_threads

_RECORDS = RecordCache(most=half_of_cache_bytes)
_BUFFERS = BufferPool(most=half_of_cache_bytes)
register_bytes("records of simulations", _RECORDS)
register_bytes("buffers for records", _BUFFERS)


class Recorder(NamedTuple):
    """How simulations were run whose records are kept on the host. Hashable.

    Their numbers are their own inputs and behind them the numbers of what they read.

    Attributes:
        compiled: the program; `room` for how many records, at most one for each row that it reads.
        quick: see `call`.
        once: whether its records are read only once.
        reads: what recorded its stream, if it reads one.
    """

    compiled: CompiledProgram
    room: int
    quick: bool
    once: bool = False
    reads: Optional["Recorder"] = None

    def outputs(self, numbers: np.ndarray) -> np.ndarray:
        """Outputs of simulations with these numbers (n, k); their records are then known."""
        return _RECORDS.ran(self, numbers.T, self._run_for(len(numbers)))

    def rows(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Their records, as `RecordCache.rows`."""
        run = self._run_for(len(numbers))
        return _RECORDS.rows(self, numbers.T, run, once=self.once)

    def columns(self, numbers: np.ndarray, first: np.ndarray) -> list[np.ndarray]:
        """Each number in their records, as `RecordCache.columns`."""
        run = self._run_for(len(numbers))
        return _RECORDS.columns(self, numbers.T, first, self.room, run)

    def _run_for(self, count: int) -> Callable[[np.ndarray], Tables]:
        """Runs those of `count` simulations that nobody ran yet."""
        # Also where these are few: another width would have to be compiled.
        width = self.compiled.width(count, default_threads())

        def run(table: np.ndarray) -> Tables:
            own, others = np.split(table, [self.compiled.size])
            rows, room = None, self.room
            if self.reads is not None:
                rows = self.reads.rows(others.T)
                room = min(room, max(len(each) for each in rows))
            alone = self.quick and table.shape[1] == 1
            found, recorded = self.compiled.run_table(
                own, stream=rows, room=room, memory=_BUFFERS, quick=alone, width=width
            )
            assert recorded is not None
            return found, *recorded

        return run
