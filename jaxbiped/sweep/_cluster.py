"""Executors for sweeps: processes of this machine, and workers of a dask scheduler."""

import multiprocessing
import os
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import Any

from jaxbiped._checks import ArgumentError, check_positive
from jaxbiped.lanes._engine import THREADS_VARIABLE, default_threads

_TIMEOUT = 10.0
"""How long to wait for a scheduler [s]."""


def local_executor(workers: int) -> Executor:
    """So many new processes of this machine, each with its share of the cores.

    Raises:
        ArgumentError: no workers.
    """
    check_positive("workers", workers)
    share = max(1, default_threads() // int(workers))
    # JAX deadlocks after a fork.
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(
        int(workers), mp_context=context, initializer=_use_threads, initargs=(share,)
    )


def _use_threads(count: int) -> None:
    os.environ[THREADS_VARIABLE] = str(count)


def cluster_executor(address: str, *, timeout: float = _TIMEOUT) -> tuple[Executor, int]:
    """The workers of a dask scheduler, and how many there are; for `sweep`.

    Args:
        address: of the scheduler, as "tcp://host:8786".
        timeout: how long to wait for it [s].

    Raises:
        ArgumentError: nobody answers there, it has no workers, or distributed is not installed.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ArgumentError(
            f"scheduler = {address!r} needs distributed: install jaxbiped[sweep]."
        ) from None
    try:
        client: Any = Client(address, timeout=timeout)
    except (OSError, ValueError) as error:
        raise ArgumentError(
            f"scheduler = {address!r} does not answer ({error}): it must be the address of a "
            "running dask scheduler, as tcp://host:8786."
        ) from None
    workers = len(client.scheduler_info()["workers"])
    if not workers:
        client.close()
        raise ArgumentError(f"scheduler = {address!r} has no workers: start one at least.")
    return client.get_executor(), workers
