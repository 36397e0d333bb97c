"""Compiled programs, run over many simulations at once: queues, threads and arrays."""

import contextlib
import dataclasses
import pickle
import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped.compiler.runtime._kernel import Kernel
from jaxbiped.compiler.runtime._machine_code import default_threads, run_in_threads
from jaxbiped.compiler.runtime._processors import (
    AbstractProcessor,
    HostProcessor,
    InputTable,
    Launch,
    input_streams_of,
)
from jaxbiped.compiler.runtime._program import Program, Recorded, outputs_of

HOST = HostProcessor()


class Ran(NamedTuple):
    """Outputs of n simulations, leaves (n, …), and what they recorded."""

    outputs: PyTree
    recorded: Recorded | None


@dataclasses.dataclass(frozen=True)
class CompiledProgram:
    """A program compiled for inputs of one structure. Traced when that is needed.

    Attributes:
        kernel: what runs it.
        processor: what that runs on.
    """

    kernel: Kernel
    processor: AbstractProcessor = HOST

    @staticmethod
    def of(
        program: Program, inputs: PyTree, processor: AbstractProcessor = HOST
    ) -> "CompiledProgram":
        """Of a program; `inputs` are one simulation's, or their shapes."""
        return CompiledProgram(Kernel.of_program(program, inputs), processor)

    @staticmethod
    def kept(digest: str, processor: AbstractProcessor = HOST) -> "CompiledProgram":
        """The one with this fingerprint; see `Kernel.kept`."""
        return CompiledProgram(Kernel.kept(digest), processor)

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process has it by its fingerprint."""
        if self.kernel.digest is None:
            raise pickle.PicklingError("a program that has no fingerprint")
        return CompiledProgram.kept, (self.kernel.digest, self.processor)

    def __fingerprint__(self) -> object:
        digest = self.kernel.digest
        return object() if digest is None else (digest, self.processor.name)

    def check(self) -> None:
        """Waits until it is traced, or known to have been.

        Raises:
            UnknownPrimitiveError: it holds an operation that lanes do not have.
        """
        _ = self.kernel.signature

    def runs_at_once(self, count: int) -> bool:
        """Whether it can run `count` simulations without being traced or compiled."""
        return self.processor.ready(self.kernel, self.width(count, default_threads()))

    def width(self, count: int, threads: int) -> int:
        return self.processor.width(self.kernel, count, threads)

    def prepare(self, width: int) -> None:
        self.processor.prepare(self.kernel, width)

    def make_ready(self, count: int) -> None:
        """Begins to trace and compile, in the background, what running `count` of them needs."""
        width, own = self.width(count, default_threads()), object()
        if self.kernel.begun.setdefault((self.processor.name, width), own) is own:
            threading.Thread(target=self._begin, args=(width,)).start()

    def _begin(self, width: int) -> None:
        # Who needs the program is told why there is none.
        with contextlib.suppress(Exception):
            self.prepare(width)

    def run(self, inputs: PyTree, **options: Any) -> Ran:
        """Runs n simulations; leaves of `inputs` have a leading axis of n.

        They are 64-bit floating-point numbers, whatever they stand for. See `run_table` for the
        options.
        """
        table = InputTable.of_leaves([np.asarray(leaf) for leaf in jtu.tree_leaves(inputs)])
        found, recorded = self.run_table(table, **options)
        with np.errstate(invalid="ignore"):
            outputs = outputs_of(
                self.kernel.outline.outputs,
                found.T,
                lambda part, dtype: np.moveaxis(part, -1, 0).astype(dtype, order="C"),
            )
        return Ran(outputs, recorded)

    def run_table(
        self,
        table: InputTable,
        *,
        schedule: np.ndarray | None = None,
        stream: Sequence[np.ndarray] | None = None,
        room: int = 0,
        memory: Callable[[tuple[int, ...]], np.ndarray] = np.zeros,
        threads: int | None = None,
        width: int | None = None,
        quick: bool = False,
    ) -> tuple[np.ndarray, Recorded | None]:
        """Runs n simulations; their outputs, shape (n, numbers), leaf by leaf.

        Args:
            table: inputs.
            schedule: increasing times of the records, shape (m,), where the program has such.
            stream: rows for each simulation, n arrays (rows, numbers), if the program reads any;
                from the last one on where it reads `backwards`.
            room: records that each simulation has room for.
            memory: makes the array for the records, beyond which there is what it holds.
            threads: number of threads. Default: that of the environment or the machine.
            width: simulations in one vector; the results do not depend on it.
            quick: whether one thread's work is so short that nobody could interrupt it.

        Raises:
            KeyboardInterrupt: the user interrupts; the simulations end within a tenth of a second.
        """
        count, signature = table.simulations, self.kernel.signature
        outputs = np.full((count, signature.outputs), np.nan)
        times = np.ascontiguousarray([] if schedule is None else schedule, dtype=np.float64)
        streams = input_streams_of(stream, count, signature.row, backwards=signature.backwards)
        shape = (count, room, signature.recorded)
        records = memory(shape)
        if schedule is not None:
            records[:] = np.nan
        record_counts = np.zeros(count, dtype=np.int64)
        queue, stop = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64)
        many = threads or default_threads()
        chosen = self.width(count, many) if width is None else width
        arrays = dict(
            queue=queue,
            stop=stop,
            inputs=table.numbers,
            input_places=table.places,
            input_steps=table.steps,
            outputs=outputs,
            records=records,
            record_counts=record_counts,
            schedule=times,
            streams=streams.starts,
            stream_lengths=streams.lengths,
        )
        numbers = dict(
            count=count, record_room=room, schedule_length=len(times), stream_stride=streams.stride
        )
        if count:
            launch = Launch(arrays, numbers, streams.rows, table)
            job = self.processor.job(self.kernel, launch, chosen, many)
            run_in_threads(job.run, job.workers, stop, quick=quick)
            job.finish()
        recorded = Recorded(records, record_counts) if signature.records else None
        return self._whole(outputs), recorded

    def _whole(self, varying: np.ndarray) -> np.ndarray:
        """The outputs with those among them that are always the same."""
        constants = self.kernel.signature.constants
        if not constants:
            return varying
        whole = np.empty((len(varying), varying.shape[1] + len(constants)))
        whole[:, list(constants)] = list(constants.values())
        whole[:, [i for i in range(whole.shape[1]) if i not in constants]] = varying
        return whole
