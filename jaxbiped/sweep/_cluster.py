"""Executors for sweeps: spawned processes here, or a dask.distributed cluster."""

import importlib
import multiprocessing
import os
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import Any

from jaxbiped._checks import ArgumentError, ResourceError, check_positive
from jaxbiped._environment import THREADS_VARIABLE
from jaxbiped.basins._arguments import check_whole
from jaxbiped.compiler import default_threads

_RETRIES = 3
"""Times that a chunk is labelled again where its worker died."""


def cluster_executor(address: str, *, timeout: float = 10.0) -> tuple[Executor, int]:
    """An executor of a dask.distributed cluster, and how many chunks it runs at once.

    Args:
        address: of the scheduler, such as "tcp://10.0.0.1:8786".
        timeout: how long to wait for it [s].

    Returns:
        The executor and the number of the workers' threads. `shutdown` ends neither of them.

    Raises:
        ArgumentError: no scheduler answers at this address.
        ResourceError: the package distributed is missing, or the scheduler has no workers.
    """
    check_positive("timeout", timeout, "s")
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise ResourceError(
            f"scheduler = {address!r} needs the package distributed: pip install jaxbiped[sweep]."
        ) from None
    try:
        client = distributed.Client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise ArgumentError(
            f"scheduler = {address!r} does not answer ({reason}): it must be the address of a "
            "running dask scheduler, such as 'tcp://10.0.0.1:8786'."
        ) from None
    threads = sum(client.nthreads().values())
    if not threads:
        client.close()
        raise ResourceError(
            f"scheduler = {address!r} has no workers: start at least one dask worker for it."
        )
    return client.get_executor(pure=False, retries=_RETRIES), threads


def local_executor(workers: int) -> ProcessPoolExecutor:
    """An executor of spawned processes, each with its share of this process's threads.

    Args:
        workers: how many processes, at least 1.

    Returns:
        The executor; `shutdown` ends the processes.

    Raises:
        ArgumentError: `workers` is not a whole number of at least 1.
    """
    check_whole("workers", workers, 1)
    return ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_limit_threads,
        initargs=(max(1, default_threads() // workers),),
    )


def _limit_threads(threads: int) -> None:
    os.environ[THREADS_VARIABLE] = str(threads)
