"""Workers: chunks of a sweep labelled here, by spawned processes or by a dask cluster."""

import contextlib
import importlib
import itertools
import multiprocessing
import os
import pickle
import sys
from collections.abc import Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from pathlib import Path
from typing import Any

import numpy as np

from jaxbiped._checks import ArgumentError, ResourceError, check_count, check_positive
from jaxbiped._files import THREADS_VARIABLE
from jaxbiped.compiler import default_threads
from jaxbiped.sweep._labelling import Labelling
from jaxbiped.sweep._store import Layout, fields_of
from jaxbiped.sweep.starts._starts import AbstractStarts, GivenStarts

_RETRIES = 3
"""Times that a chunk is labelled again where its worker died."""
_AHEAD = 2
"""Chunks handed out for each worker, so that none waits for the next."""


def cluster_executor(address: str, *, timeout: float = 10.0) -> tuple[Executor, int]:
    """An executor of a dask.distributed cluster, and the number of chunks that it runs at once.

    Args:
        address: address of the scheduler, such as "tcp://10.0.0.1:8786".
        timeout: time to wait for the scheduler [s].

    Returns:
        The executor and the number of the workers' threads. `shutdown` does not end the workers.

    Raises:
        ArgumentError: no scheduler answers at the address.
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
        workers: number of processes, at least 1.

    Returns:
        The executor; `shutdown` ends the processes.

    Raises:
        ArgumentError: `workers` is not a whole number of at least 1; or the script that is run has
            no main guard, so that its workers, which import it, would begin workers of their own.
    """
    check_count("workers", workers)
    if _is_unguarded():
        raise ArgumentError(f"workers = {workers} is not allowed here: {_GUARD}.")
    return ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_limit_threads,
        initargs=(max(1, default_threads() // workers),),
    )


def _limit_threads(threads: int) -> None:
    os.environ[THREADS_VARIABLE] = str(threads)


Fields = dict[str, np.ndarray]


def compute_chunks(
    labelling: Labelling,
    layout: Layout,
    chunks: np.ndarray,
    executor: Executor | None,
    workers: int,
) -> Iterator[tuple[int, Fields]]:
    """Chunks and their fields as they are ready, a few at a time for each worker.

    Raises:
        ArgumentError: the workers cannot be sent the starts.
        ResourceError: the workers were lost.
    """
    if executor is None and labelling.effort.may_use_device:
        # While a chunk is written, the device labels the next one.
        with ThreadPoolExecutor(1) as pool:
            yield from compute_chunks(labelling, layout, chunks, pool, 1)
        return
    if executor is None:
        for chunk in map(int, chunks):
            yield chunk, label_range(labelling, *_part(layout, chunk))
        return
    _check_sent(executor, labelling, layout)
    queue = map(int, chunks)
    running: dict[Future[Fields], int] = {}
    try:
        while True:
            for chunk in itertools.islice(queue, _AHEAD * workers - len(running)):
                with _told_if_lost(executor, RuntimeError):
                    future = executor.submit(label_range, labelling, *_part(layout, chunk))
                running[future] = chunk
            if not running:
                return
            ready, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ready:
                chunk = running.pop(future)
                with _told_if_lost(executor, BrokenExecutor, CancelledError, OSError):
                    fields = future.result()
                yield chunk, fields
    finally:
        for future in running:
            future.cancel()


def label_range(labelling: Labelling, starts: AbstractStarts, first: int, last: int) -> Fields:
    """The fields of the starts from `first` up to `last`, flat: what a worker computes."""
    batch = starts.batch(labelling, first, last)
    return fields_of(starts, labelling(batch.states, parameters=batch.parameters), batch)


def _part(layout: Layout, chunk: int) -> tuple[AbstractStarts, int, int]:
    """What a worker needs of a chunk: starts that are given need not travel with every one."""
    first, last = layout.numbers(chunk)
    if isinstance(layout.starts, GivenStarts):
        return layout.starts.between(first, last), 0, last - first
    return layout.starts, first, last


@contextlib.contextmanager
def _told_if_lost(executor: Executor, *signs: type[Exception]) -> Iterator[None]:
    """Within, errors of these kinds mean that the workers were lost."""
    try:
        yield
    except Exception as error:
        # A cluster has its own, such as KilledWorker, whose package may be missing here.
        of_cluster = type(error).__module__.split(".")[0] == "distributed"
        if not of_cluster and not isinstance(error, signs):
            raise
        what = " ".join(str(error).split()).partition(". ")[0] or type(error).__name__
        remedy = _GUARD if _is_unguarded() else "restart it and run again"
        raise ResourceError(
            f"executor = {type(executor).__name__} lost its workers ({what.rstrip('.')}): "
            f"{remedy}; complete chunks remain in the store."
        ) from None


_GUARD = (
    'workers import the script that makes them, which must do so below if __name__ == "__main__"'
)


def _is_unguarded() -> bool:
    """Whether a script is run that has no main guard."""
    script = Path(getattr(sys.modules["__main__"], "__file__", None) or __file__)
    return script.is_file() and "__main__" not in script.read_text("utf-8", "replace")


def _check_sent(executor: Executor, labelling: Labelling, layout: Layout) -> None:
    """Raises `ArgumentError` where other processes could not read what they are sent."""
    if not isinstance(executor, ProcessPoolExecutor):
        return
    try:
        pickle.dumps((labelling, *_part(layout, 0)))
    except Exception as error:
        raise ArgumentError(
            f"starts cannot be sent to other processes ({error}): a function that completes them "
            "must be a module's own, not a lambda or another function's."
        ) from None
