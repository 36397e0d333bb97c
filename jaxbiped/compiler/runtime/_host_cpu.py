"""Host CPU: the features that code is generated for, and the threads that run it."""

import os
import threading
from collections.abc import Callable
from typing import NamedTuple

import llvmlite.binding as llvm
import numpy as np

from jaxbiped._environment import THREADS_VARIABLE, VECTOR_VARIABLE, environment_number
from jaxbiped.caching._caches import bounded_cache

_WITHOUT = {128: "avx", 256: "avx512f"}
"""The instruction set that gives more bits than these."""
_POLL = 0.1
"""How long to wait before looking whether the user interrupts [s]."""


class Host(NamedTuple):
    """The CPU that code is made for.

    Attributes:
        triple: architecture and system, in LLVM's words.
        cpu: its model; `features` its instruction sets.
        width: 64-bit numbers in one vector register.
        scales: whether it multiplies by powers of two in one instruction.
    """

    triple: str
    cpu: str
    features: str
    width: int
    scales: bool


@bounded_cache(1)
def host() -> Host:
    """This machine, or what `VECTOR_VARIABLE` leaves of it."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features()
    width = 8 if features.get("avx512f") and features.get("avx512dq") else 4
    if not features.get("avx2") and width == 4:
        width = 2
    text = features.flatten()
    chosen = environment_number(VECTOR_VARIABLE)
    if chosen in _WITHOUT and chosen // 64 < width:
        # What a feature implies goes with it.
        width, text = chosen // 64, f"{text},-{_WITHOUT[chosen]}"
    if width == 8:
        # LLVM else keeps to half registers on some CPUs.
        text += ",-prefer-256-bit"
    return Host(llvm.get_default_triple(), llvm.get_host_cpu_name(), text, width, width == 8)


def default_threads() -> int:
    """Threads to use where nobody says."""
    chosen = environment_number(THREADS_VARIABLE)
    if chosen is not None:
        return chosen
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_in_threads(
    work: Callable[[], object], workers: int, stop: np.ndarray, *, quick: bool
) -> None:
    """Runs the same work in several threads, which share its queue; `stop` ends it early.

    What is `quick` needs no thread: it is over before a user could interrupt.
    """
    if workers == 1 and quick:
        work()
        return
    # Not their joins: one that an interrupt ends may take a thread that runs for one that stopped.
    ends = [threading.Event() for _ in range(workers)]

    def worked(end: threading.Event) -> None:
        try:
            work()
        finally:
            end.set()

    for end in ends:
        threading.Thread(target=worked, args=(end,), daemon=True).start()
    try:
        for end in ends:
            # Waiting without end would keep the interrupt waiting, too.
            while not end.wait(_POLL):
                pass
    except BaseException:
        stop[0] = 1
        for end in ends:
            end.wait()
        raise
