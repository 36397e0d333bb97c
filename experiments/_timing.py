"""Times of runs that take turns, so that a machine which is busy for a while is so for all."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np


def seconds_of(
    work: Mapping[Any, Callable[[], Any]],
    rounds: int,
    *,
    least: float = 0.0,
    warm: bool = True,
    statistic: Callable[[list[float]], Any] = np.median,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[Any, float]:
    """Seconds of each run by name, its median, after one run each that does not count.

    Args:
        work: runs by name.
        rounds: how often each is timed.
        least: more often, until all runs together took so long [s].
        warm: whether one run each goes before.
        statistic: of a run's times, that counts.
        clock: the time [s], of the wall unless given.
    """
    for run in work.values() if warm else ():
        jax.block_until_ready(run())
    taken: dict[Any, list[float]] = {name: [] for name in work}
    done = 0
    while done < rounds or sum(map(sum, taken.values())) < least:
        done += 1
        for name, run in work.items():
            began = clock()
            jax.block_until_ready(run())
            taken[name].append(clock() - began)
    return {name: float(statistic(times)) for name, times in taken.items()}


def timed(run: Callable[[], Any]) -> tuple[Any, float, float]:
    """What a run returns, and its seconds by the clock and of the processor."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = jax.block_until_ready(run())
    return found, time.perf_counter() - wall, time.process_time() - cpu
