"""Processors: what a compiled program's simulations run on, and this machine's CPU as one."""

import abc
import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxbiped.compiler.codegen._lane_scheduler import FIELDS
from jaxbiped.compiler.runtime._kernel import Kernel
from jaxbiped.compiler.runtime._machine_code import host

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
        every = [np.concatenate([np.zeros((1, 0)), *shared], axis=1)]
        if own:
            every.append(np.concatenate(own, axis=1))
        numbers = np.concatenate([each.reshape(-1) for each in every], dtype=np.float64)
        places = np.empty(len(steps), dtype=np.int64)
        # The own ones of the first simulation lie just behind the shared ones.
        places[np.argsort(steps != 0, kind="stable")] = np.arange(len(steps))
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
    rows = [
        np.ascontiguousarray(each, dtype=np.float64) for each in ([] if stream is None else stream)
    ]
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
    starts = np.array([each.ctypes.data for each in rows], dtype=np.int64)
    if not backwards:
        return InputStreams(starts, lengths, numbers, rows)
    size = numbers * np.dtype(np.float64).itemsize
    return InputStreams(starts + (lengths - 1) * size, lengths, -numbers, rows)


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

    @property
    def simulations(self) -> int:
        """How many simulations there are."""
        return self.numbers["count"]


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

        return Job(work, min(threads, -(-launch.simulations // width)), lambda: None)
