"""Lane call: simulations that a compiled program of XLA has run on the host."""

import enum
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxbiped._types import Numbers
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram
from jaxbiped.compiler.runtime._record_cache import BLOCK
from jaxbiped.compiler.runtime._recorder import Recorder
from jaxbiped.compiler.runtime._threads import default_threads


class Part(enum.Enum):
    """Which part of what simulations give is wanted."""

    ALL = "outputs and records"
    OUTPUTS = "outputs, while records are kept on the host"
    COLUMNS = "records that were kept on the host"


class Schedule:
    """Times of records, the same for every simulation. Compared by identity."""

    def __init__(self, times: np.ndarray) -> None:
        self.times = np.ascontiguousarray(times, dtype=np.float64)


def run_lanes(
    numbers: Numbers,
    stream: Numbers | None = None,
    *,
    compiled: CompiledProgram,
    schedule: Schedule | None,
    room: int,
    quick: bool,
    wants: Part,
    recorder: Recorder | None,
) -> list[np.ndarray]:
    """Of inputs (n, k) and their streams: outputs (n, o), and what was recorded."""
    given = np.asarray(numbers)
    if recorder is not None and wants is Part.OUTPUTS:
        return [recorder.outputs(given).T]
    if recorder is not None and wants is Part.COLUMNS:
        return recorder.columns(given, np.asarray(stream))
    times = None if schedule is None else schedule.times
    alone = quick and len(given) == 1
    width = compiled.width(len(given), default_threads())

    def run(part: slice, rows: Sequence[np.ndarray] | None) -> list[np.ndarray]:
        outputs, recorded = compiled.run_table(
            given[part].T,
            schedule=times,
            stream=rows,
            room=room if times is None else len(times),
            quick=alone,
            width=width,
        )
        return [outputs.T, *(recorded or ())]

    if recorder is None:
        return run(slice(None), None if stream is None else list(np.asarray(stream)))
    parts = [slice(k, k + BLOCK) for k in range(0, max(1, len(given)), BLOCK)]
    found = [run(part, recorder.rows(np.asarray(stream)[part])) for part in parts]
    return [np.concatenate(each) for each in zip(*found, strict=True)]


class LaneCall(NamedTuple):
    """What a compiled program calls: simulations of a program, run in this way.

    Attributes:
        simulations: how many at once; `params` of the operation.
    """

    simulations: int
    params: dict[str, Any]

    def __call__(self, *given: np.ndarray) -> list[np.ndarray]:
        return run_lanes(*given, **self.params)

    def __fingerprint__(self) -> object:
        return tuple(self)

    def ready(self) -> bool:
        """Whether it runs without tracing or compiling."""
        compiled: CompiledProgram = self.params["compiled"]
        wants_code = self.params["wants"] is not Part.COLUMNS
        return not wants_code or compiled.runs_at_once(self.simulations)
