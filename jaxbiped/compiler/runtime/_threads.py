"""Threads: how many run a program, and how a user's interrupt ends them."""

import os
import threading
from collections.abc import Callable

import numpy as np

from jaxbiped._environment import THREADS_VARIABLE, environment_number

_POLL = 0.1
"""How long to wait before looking whether the user interrupts [s]."""


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
