"""Host processor: kernels as vector code on this machine's CPU, in several threads."""

import ctypes

import numpy as np

from jaxbiped.compiler.codegen._lane_scheduler import FIELDS
from jaxbiped.compiler.runtime._host_cpu import host
from jaxbiped.compiler.runtime._kernel import Kernel
from jaxbiped.compiler.runtime._processor import AbstractProcessor, Job, Launch

_MANY = 8
"""Vectors for each thread from which on two are computed side by side."""


class HostProcessor(AbstractProcessor):
    """This machine's CPU."""

    name = "lanes"

    def hindrance(self) -> str | None:
        return None

    def width(self, kernel: Kernel, count: int, threads: int) -> int:
        """A thread that has only one simulation is faster with it alone.

        Where there are many, two of the host's vectors side by side: while one waits, the other one
        is computed. What a map loops over fills the caches instead.
        """
        if count <= threads:
            return 1
        if count < _MANY * threads * host().width:
            return host().width
        return host().width * (1 if kernel.signature.maps else 2)

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
