"""Lane call: simulations that a compiled program of XLA has run on the host."""

import enum
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxbiped._types import Numbers
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._host_cpu import default_threads
from jaxbiped.compiler.runtime._record_cache import BLOCK, Recorder


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
    """How simulations are run, and what of it is wanted. Hashable.

    Attributes:
        compiled: the program.
        schedule: of its records, where it has such; else there is `room` for so many.
        quick: whether a single simulation is over before a user could interrupt.
        wants: which part of what they give.
        recorder: what recorded their streams, or keeps their records.
    """

    compiled: CompiledProgram
    schedule: Schedule | None = None
    room: int = 0
    quick: bool = False
    wants: Part = Part.ALL
    recorder: Recorder | None = None

    def run(self, numbers: Numbers, stream: Numbers | None = None) -> list[np.ndarray]:
        """Of inputs (n, k) and their streams: outputs (n, o), and what was recorded."""
        given, recorder = np.asarray(numbers), self.recorder
        if recorder is not None and self.wants is Part.OUTPUTS:
            return [recorder.outputs(given).T]
        if recorder is not None and self.wants is Part.COLUMNS:
            return recorder.columns(given, np.asarray(stream))
        times = None if self.schedule is None else self.schedule.times
        width = self.compiled.width(len(given), default_threads())

        def run(part: slice, rows: Sequence[np.ndarray] | None) -> list[np.ndarray]:
            outputs, recorded = self.compiled.run_table(
                given[part].T,
                schedule=times,
                stream=rows,
                room=self.room if times is None else len(times),
                quick=self.quick and len(given) == 1,
                width=width,
            )
            return [outputs.T, *(recorded or ())]

        if recorder is None:
            return run(slice(None), None if stream is None else list(np.asarray(stream)))
        parts = [slice(k, k + BLOCK) for k in range(0, max(1, len(given)), BLOCK)]
        found = [run(part, recorder.rows(np.asarray(stream)[part])) for part in parts]
        return [np.concatenate(each) for each in zip(*found, strict=True)]


class LaneCall(NamedTuple):
    """What a compiled program calls: so many simulations at once, run in this way."""

    simulations: int
    how: LaneRun

    def __call__(self, *given: np.ndarray) -> list[np.ndarray]:
        return self.how.run(*given)

    def __fingerprint__(self) -> object:
        return tuple(self)

    def ready(self) -> bool:
        """Whether it runs without tracing or compiling."""
        wants_code = self.how.wants is not Part.COLUMNS
        return not wants_code or self.how.compiled.runs_at_once(self.simulations)
