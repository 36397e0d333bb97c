"""Processors: what a compiled program's simulations run on, this machine's CPU or its devices."""

import abc
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from jaxbiped.compiler.runtime._input_streams import InputStreams
from jaxbiped.compiler.runtime._kernel import Kernel


class Launch(NamedTuple):
    """What a kernel is given, by the names of `FIELDS`.

    Attributes:
        arrays: on the host; `outputs`, `records` and `record_counts` are written.
        numbers: whole numbers; `count` is that of the simulations.
        streams: that they read.
    """

    arrays: Mapping[str, np.ndarray]
    numbers: Mapping[str, int]
    streams: InputStreams

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
