"""Device processor: kernels on all CUDA devices of this machine, each taking parts of a batch.

Where a simulation's results go is told by its own number, so they do not depend on who runs it.
"""

import itertools
import queue
import threading

import numpy as np

from jaxbiped.compiler.codegen._ptx_kernel import THREADS
from jaxbiped.compiler.runtime._cuda_device import devices
from jaxbiped.compiler.runtime._kernel import Kernel
from jaxbiped.compiler.runtime._processor import AbstractProcessor, Job, Launch

_MOST_BYTES = 1 << 30
"""Of a part's arrays: a device's memory holds several such."""
_FEWEST = 32
"""Simulations for each multiprocessor from which on a device is worth its while: of 4,000 starts
an H100 labelled 1.3 times as many a second as 16 cores beside it, of 2,000 0.6 times."""


class DeviceProcessor(AbstractProcessor):
    """All devices that this process sees."""

    name = "cuda"

    def hindrance(self) -> str | None:
        found = devices()
        return None if found.usable else found.missing

    def width(self, kernel: Kernel, count: int, threads: int) -> int:
        """One: threads have no vectors."""
        return 1

    def prepare(self, kernel: Kernel, width: int) -> None:
        for device in devices().usable:
            device.load(kernel)

    def ready(self, kernel: Kernel, width: int) -> bool:
        return all(kernel.has_ptx(device.architecture) for device in devices().usable)

    def names(self) -> list[str]:
        """The devices' names."""
        return [device.name for device in devices().usable]

    def fills(self, count: int) -> bool:
        """Whether there is a device, and `count` simulations keep it busy."""
        found = devices().usable
        return bool(found) and count >= _FEWEST * sum(each.multiprocessors for each in found)

    def job(self, kernel: Kernel, launch: Launch, width: int, threads: int) -> Job:
        found = devices().usable
        parts: queue.SimpleQueue[slice] = queue.SimpleQueue()
        for part in _parts(launch, len(found)):
            parts.put(part)
        idle, errors, stop = list(found), list[BaseException](), launch.arrays["stop"]
        lock = threading.Lock()

        def work() -> None:
            with lock:
                device = idle.pop()
            try:
                loaded = device.load(kernel)
                while not stop[0]:
                    try:
                        place = parts.get_nowait()
                    except queue.Empty:
                        return
                    device.run(loaded, _part(launch, place), stop)
            except BaseException as error:  # of a thread: told by `finish`
                errors.append(error)

        def finish() -> None:
            if errors:
                raise errors[0]

        return Job(work, min(len(found), parts.qsize()), finish)


def _parts(launch: Launch, count: int) -> list[slice]:
    """A batch cut for `count` devices, and so that each part has room on one."""
    size = sum(array.nbytes for name, array in launch.arrays.items() if name != "schedule")
    size += sum(each.nbytes for each in launch.rows)
    wanted = max(-(-size // _MOST_BYTES), min(count, -(-launch.simulations // THREADS)))
    bounds = np.linspace(0, launch.simulations, wanted + 1).astype(int)
    return [slice(a, b) for a, b in itertools.pairwise(map(int, bounds)) if b > a]


def _part(launch: Launch, place: slice) -> Launch:
    arrays, rows = launch.arrays, launch.rows[place]
    before = np.cumsum([0, *(each.nbytes for each in rows)])[: len(rows)]
    own = np.array([each.ctypes.data for each in rows], dtype=np.int64)
    starts = arrays["streams"][place] - own + before if rows else np.zeros(0, dtype=np.int64)
    table = launch.table.part(place)
    taken = dict(
        queue=np.zeros(1, dtype=np.int64),
        stop=np.zeros(1, dtype=np.int64),
        inputs=table.numbers,
        input_places=table.places,
        input_steps=table.steps,
        outputs=arrays["outputs"][place],
        records=arrays["records"][place],
        record_counts=arrays["record_counts"][place],
        schedule=arrays["schedule"],
        streams=starts,
        stream_lengths=arrays["stream_lengths"][place],
    )
    every = np.concatenate([each.ravel() for each in rows]) if rows else np.zeros(0)
    return Launch(taken, {**launch.numbers, "count": table.simulations}, [every], table)
