"""Settles on which cores an experiment runs: to be imported before JAX is."""

import os


def settle(count: int) -> int:
    """Keeps this process, and numba's threads, to so many cores; returns how many there are."""
    cores = sorted(os.sched_getaffinity(0))[-count:] if hasattr(os, "sched_getaffinity") else []
    if cores:
        os.sched_setaffinity(0, cores)
    os.environ.setdefault("NUMBA_NUM_THREADS", str(len(cores) or count))
    return len(cores)
