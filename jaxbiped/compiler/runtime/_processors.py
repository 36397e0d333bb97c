"""Processors: what a compiled program's simulations run on: this machine's CPU, its CUDA devices.

Devices take parts of a batch. Where a simulation's results go is told by its own number, so they do
not depend on who runs it.
"""

import abc
import ctypes
import itertools
import queue
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxbiped.compiler.codegen._lane_scheduler import FIELDS
from jaxbiped.compiler.codegen._ptx_kernel import THREADS
from jaxbiped.compiler.runtime._cuda_device import WRITTEN, devices
from jaxbiped.compiler.runtime._kernel import Kernel
from jaxbiped.compiler.runtime._machine_code import host

_MOST_BYTES = 1 << 30
"""Of a part's arrays: a device's memory holds several such."""
_FEWEST = 32
"""Simulations for each multiprocessor from which on a device is worth its while: of 4,000 starts
an H100 labelled 1.3 times as many a second as 16 cores beside it, of 2,000 0.6 times."""
_MANY = 8
"""Vectors for each thread from which on two are computed side by side."""


class InputTable(NamedTuple):
    """Inputs of some `simulations`: number k of simulation i is `places[k] + i steps[k]`.

    Attributes:
        numbers: the `shared` ones of all simulations, and behind them those of each, one by one.
    """

    simulations: int
    shared: int
    numbers: np.ndarray
    places: np.ndarray
    steps: np.ndarray

    @staticmethod
    def of_rows(rows: np.ndarray) -> "InputTable":
        """Of n simulations that share nothing, shape (n, numbers)."""
        count, size = rows.shape
        numbers = np.ascontiguousarray(rows, dtype=np.float64).reshape(-1)
        return InputTable(count, 0, numbers, np.arange(size), np.full(size, size, dtype=np.int64))

    @staticmethod
    def of_leaves(leaves: Sequence[np.ndarray]) -> "InputTable":
        """Of arrays (n, …); those that repeat one entry in memory are shared."""
        count = leaves[0].shape[0]
        shared, own, is_own = list[np.ndarray](), list[np.ndarray](), list[bool]()
        for leaf in leaves:
            varies = count > 1 and leaf.strides[0] != 0
            rows = (leaf if varies else leaf[:1]).reshape(count if varies else 1, -1)
            (own if varies else shared).append(rows)
            is_own += [varies] * rows.shape[1]
        steps = np.array(is_own, dtype=np.int64) * sum(is_own)
        every = *shared, np.concatenate([np.zeros((count, 0)), *own], axis=1)
        numbers = np.concatenate([each.reshape(-1) for each in every], dtype=np.float64)
        # The own ones of the first simulation lie just behind the shared ones.
        places = np.argsort(np.argsort(steps != 0, kind="stable"))
        return InputTable(count, len(steps) - sum(is_own), numbers, places, steps)

    def part(self, place: slice) -> "InputTable":
        """Of some simulations, one behind the other."""
        if place.stop - place.start == self.simulations:
            return self
        own = self.numbers[self.shared :].reshape(self.simulations, -1)[place]
        numbers = np.concatenate([self.numbers[: self.shared], own.reshape(-1)])
        return self._replace(simulations=len(own), numbers=numbers)


class InputStreams(NamedTuple):
    """Of n simulations.

    Attributes:
        starts: address of the row that each reads first, shape (n,).
        lengths: how many rows each has, shape (n,).
        stride: numbers from one row to the next.
        rows: what must stay in memory.
    """

    starts: np.ndarray
    lengths: np.ndarray
    stride: int
    rows: list[np.ndarray]


def input_streams_of(
    stream: Sequence[np.ndarray] | None, count: int, numbers: int, *, backwards: bool
) -> InputStreams:
    """Of `count` simulations that read rows of so many numbers, of none where these are 0.

    Raises:
        ValueError: another number of arrays, or one without rows or with rows of another length.
    """
    given = () if stream is None else stream
    rows = [np.ascontiguousarray(each, dtype=np.float64) for each in given]
    wanted = count if numbers else 0
    if len(rows) != wanted:
        raise ValueError(f"stream has {len(rows)} arrays of rows: it must have {wanted}.")
    for each in rows:
        # Machine code reads the rows unchecked.
        if each.ndim != 2 or len(each) == 0 or each.shape[1] != numbers:
            raise ValueError(
                f"stream holds an array of shape {each.shape}: it must be (rows, {numbers}), "
                "with at least one row."
            )
    lengths = np.array([len(each) for each in rows], dtype=np.int64)
    first, stride = (-1, -numbers) if backwards else (0, numbers)
    starts = np.array([each[first].ctypes.data for each in rows], dtype=np.int64)
    return InputStreams(starts, lengths, stride, rows)


class Launch(NamedTuple):
    """What a kernel is given, by the names of `FIELDS`.

    Attributes:
        arrays: on the host; `outputs`, `records` and `record_counts` are written.
        numbers: whole numbers; `count` is that of the simulations.
        rows: of the streams that they read: what must stay in memory.
        table: the inputs that `arrays` hold.
    """

    arrays: Mapping[str, np.ndarray]
    numbers: Mapping[str, int]
    rows: list[np.ndarray]
    table: InputTable


class Job(NamedTuple):
    """A launch that is ready.

    Attributes:
        run: does it together with `workers` − 1 other threads that call the same.
        workers: how many threads it is for.
        finish: to be called in the end; raises what went wrong.
    """

    run: Callable[[], object]
    workers: int
    finish: Callable[[], None]


class AbstractProcessor(abc.ABC):
    """Compiles kernels for itself and runs them.

    Attributes:
        name: of the engine that runs on it.
    """

    name: str

    @abc.abstractmethod
    def hindrance(self) -> str | None:
        """None, or why nothing can run on it here."""

    @abc.abstractmethod
    def width(self, kernel: Kernel, count: int, threads: int) -> int:
        """Simulations in one vector where there are `count` in all."""

    @abc.abstractmethod
    def prepare(self, kernel: Kernel, width: int) -> None:
        """Compiles what is not compiled yet."""

    @abc.abstractmethod
    def ready(self, kernel: Kernel, width: int) -> bool:
        """Whether nothing is to be traced or compiled any more."""

    @abc.abstractmethod
    def job(self, kernel: Kernel, launch: Launch, width: int, threads: int) -> Job:
        """A launch of at least one simulation, compiled."""


class HostProcessor(AbstractProcessor):
    """This machine's CPU."""

    name = "lanes"

    def hindrance(self) -> str | None:
        return None

    def width(self, kernel: Kernel, count: int, threads: int) -> int:
        """A thread that has only one simulation is faster with it alone.

        Where there are many, two of the host's vectors side by side: while one waits, the other one
        is computed. What a map loops over fills the caches instead, and so does a long program.
        """
        if count <= threads:
            return 1
        if count < _MANY * threads * host().width:
            return host().width
        signature = kernel.signature
        return host().width * (1 if signature.maps or signature.long else 2)

    def prepare(self, kernel: Kernel, width: int) -> None:
        kernel.code(width)

    def ready(self, kernel: Kernel, width: int) -> bool:
        return kernel.has_code(width)

    def job(self, kernel: Kernel, launch: Launch, width: int, threads: int) -> Job:
        arrays, numbers = launch.arrays, launch.numbers
        fields = np.array(
            [arrays[n].ctypes.data if n in arrays else numbers[n] for n in FIELDS], dtype=np.int64
        )
        code = kernel.code(width)
        entry = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(code.address)
        # What a thread runs and where it writes lives as long as the thread, even where a
        # second interrupt leaves it behind.
        used = code, fields, launch

        def work(_: object = used) -> None:
            entry(fields.ctypes.data)

        return Job(work, min(threads, -(-launch.table.simulations // width)), lambda: None)


class DeviceProcessor(AbstractProcessor):
    """All devices that this process sees."""

    name = "cuda"

    def hindrance(self) -> str | None:
        found = devices()
        return None if found.usable else found.missing

    def width(self, kernel: Kernel, count: int, threads: int) -> int:
        """One: threads have no vectors."""
        return 1

    def prepare(self, kernel: Kernel, width: int) -> None:
        for device in devices().usable:
            device.load(kernel)

    def ready(self, kernel: Kernel, width: int) -> bool:
        return all(kernel.has_ptx(device.architecture) for device in devices().usable)

    def names(self) -> list[str]:
        """The devices' names."""
        return [device.name for device in devices().usable]

    def fills(self, count: int) -> bool:
        """Whether there is a device, and `count` simulations keep it busy."""
        found = devices().usable
        return bool(found) and count >= _FEWEST * sum(each.multiprocessors for each in found)

    def job(self, kernel: Kernel, launch: Launch, width: int, threads: int) -> Job:
        found = devices().usable
        parts: queue.SimpleQueue[slice] = queue.SimpleQueue()
        for part in _parts(launch, len(found)):
            parts.put(part)
        idle, errors, stop = list(found), list[BaseException](), launch.arrays["stop"]

        def work() -> None:
            device = idle.pop()
            try:
                loaded = device.load(kernel)
                while not stop[0]:
                    try:
                        place = parts.get_nowait()
                    except queue.Empty:
                        return
                    device.run(loaded, _part(launch, place), stop)
            except BaseException as error:  # of a thread: told by `finish`
                errors.append(error)

        def finish() -> None:
            if errors:
                raise errors[0]

        return Job(work, min(len(found), parts.qsize()), finish)


def _parts(launch: Launch, count: int) -> list[slice]:
    """A batch cut for `count` devices, and so that each part has room on one."""
    size = sum(array.nbytes for name, array in launch.arrays.items() if name != "schedule")
    size += sum(each.nbytes for each in launch.rows)
    wanted = max(-(-size // _MOST_BYTES), min(count, -(-launch.table.simulations // THREADS)))
    bounds = np.linspace(0, launch.table.simulations, wanted + 1).astype(int)
    return [slice(a, b) for a, b in itertools.pairwise(map(int, bounds)) if b > a]


def _part(launch: Launch, place: slice) -> Launch:
    arrays, rows = launch.arrays, launch.rows[place]
    before = np.cumsum([0, *(each.nbytes for each in rows)])[: len(rows)]
    own = np.array([each.ctypes.data for each in rows], dtype=np.int64)
    starts = arrays["streams"][place] - own + before
    table = launch.table.part(place)
    every = np.concatenate([np.zeros(0), *(each.ravel() for each in rows)])
    taken = {name: arrays[name][place] for name in (*WRITTEN, "stream_lengths")}
    taken |= {name: np.zeros(1, dtype=np.int64) for name in ("queue", "stop")}
    taken |= dict(inputs=table.numbers, streams=starts)
    numbers = {**launch.numbers, "count": table.simulations}
    return Launch({**arrays, **taken}, numbers, [every], table)
