"""Work of a solve: the time of its warm runs, and of what came before the first."""

import statistics
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax

_ENOUGH = 3.0
"""Runs that took so long together are not repeated again [s]."""


class Work(NamedTuple):
    """What a solve took.

    Attributes:
        seconds: median time of a warm run [s].
        cpu_s: median CPU time of a warm run, of all threads together [s].
        compile_s: by how much the first run took longer than a warm one [s].
    """

    seconds: float
    cpu_s: float
    compile_s: float


def work_of(run: Callable[[], Any], repeats: int) -> tuple[Any, Work]:
    """What `run` returns, and the work that it took.

    Args:
        run: solves; what it compiles is kept for its next call.
        repeats: warm runs of which the median counts; fewer where they take over 3 s together.

    Returns:
        What it returned last, and its work.
    """
    first, found = _timed(run)
    spans: list[tuple[float, float]] = []
    while not spans or (len(spans) < repeats and sum(wall for wall, _ in spans) < _ENOUGH):
        span, found = _timed(run)
        spans.append(span)
    wall, cpu = (statistics.median(span[k] for span in spans) for k in range(2))
    return found, Work(wall, cpu, max(first[0] - wall, 0.0))


def _timed(run: Callable[[], Any]) -> tuple[tuple[float, float], Any]:
    """Time and CPU time of a run [s], and what it returned."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = jax.block_until_ready(run())
    return (time.perf_counter() - wall, time.process_time() - cpu), found
