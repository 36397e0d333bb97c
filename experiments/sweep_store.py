"""Sweeps into a Zarr store, some by processes that are killed on the way: time, memory, labels.

Then labelled starts a second by one worker process and by two, of one core each. Each run is a
process of its own; what was complete when it was killed is not computed again. What a start costs
is measured without the process's own start and its compiling.
"""

import contextlib
import dataclasses
import json
import os
import resource
import shutil
import subprocess
import sys
import time
from unittest import mock

import _batches
import numpy as np
import zarr
from _experiment import Options, experiment
from _timing import timed

import jaxbiped as jb

COMPILED_BY = 256
"""Starts swept beforehand, so that nothing is compiled while the time is taken."""
MOST_COMPARED = 10_000
"""Starts up to which a sweep in memory is compared with the store."""
LONGEST = 3600.0
"""No run takes longer than this [s]."""


@dataclasses.dataclass(frozen=True)
class Job:
    """A sweep: which walker, how many starts, after which shares of the chunks to kill it."""

    model: str
    starts: int
    kills: tuple[float, ...]
    chunk: int = 16384


JOBS = (
    Job("rigid", 10_000, ()),
    Job("rigid", 1_000_000, ()),
    Job("rigid", 1_000_000, (0.3, 0.6)),
    Job("compliant", 100_000, (0.3, 0.6)),
    *(Job("compliant", 10**power, ()) for power in range(3, 8)),
)
QUICK_JOBS = (Job("rigid", 10_000, (0.3,), chunk=100),)
WORKED, QUICK_WORKED = (100_000, 2048, 5), (1024, 128, 1)
"""Starts, chunk and rounds of sweeps by worker processes."""


@experiment
def main(options: Options):
    with mock.patch.dict(os.environ, JAXBIPED_THREADS="1"):  # of each worker
        workers = by_workers(options, *options.sized(WORKED, QUICK_WORKED))
    runs = [done(options, job) for job in options.sized(JOBS, QUICK_JOBS)]
    return {"runs": runs, "workers": workers}


def by_workers(options, count, chunk, rounds):
    """Rates of one worker and of two, in turns: the best counts, for other work takes cores away.

    The first round, in which workers start up and compile, does not count.
    """
    labelling, path = _batches.labelling_of("compliant"), options.path("workers.zarr")
    rows = [{"workers": number, "starts": count, "starts_per_s": []} for number in (1, 2)]
    with contextlib.ExitStack() as stack:
        pools = [stack.enter_context(jb.local_executor(row["workers"])) for row in rows]
        for turn in range(1 + rounds):
            for row, pool in zip(rows, pools, strict=True):
                size = count if turn else 2 * chunk * row["workers"]
                shutil.rmtree(path, ignore_errors=True)
                how = dict(chunk=chunk, store=path, executor=pool, workers=row["workers"])
                found, seconds, _ = timed(_batches.swept(labelling, size, **how))
                row["starts_per_s"] += [size / seconds] if turn else []
                row["labels"] = np.asarray(found.label)
    for row in rows[::-1]:
        row["best"] = max(row["starts_per_s"])
        row["labels_differ"] = int(np.sum(row["labels"] != rows[0]["labels"]))
    return [{name: value for name, value in row.items() if name != "labels"} for row in rows]


def done(options, job):
    """A job's runs, one after another in the same store, and whether the labels are right."""
    path = options.path(f"{job.model}-{job.starts}-{len(job.kills)}.zarr")
    shutil.rmtree(path, ignore_errors=True)
    runs = [timed(lambda kill=kill: run(path, job, kill)) for kill in (*job.kills, None)]
    last = runs[-1][0]
    return {
        **dataclasses.asdict(job),
        "killed": sum(found is None for found, *_ in runs),
        "seconds": sum(seconds for _, seconds, _ in runs),
        "us_a_start": 1e6 * last["sweep_s"] / last["labelled"],
        "peak_mb": last["peak_mb"],
        "labelled_in_last_run": last["labelled"],
        "pending": last["pending"],
        "differ_from_memory": last["differ"],
    }


def run(path, job, kill):
    """What one process on the store says; None where it was killed, once so much was complete."""
    words = [sys.executable, __file__, "one", path, job.model, job.starts, job.chunk]
    process = subprocess.Popen(list(map(str, words)), stdout=subprocess.PIPE, text=True)
    killed = False
    while kill is not None and not killed and process.poll() is None:
        killed = complete(path) >= kill
        process.kill() if killed else time.sleep(0.002)
    said, _ = process.communicate(timeout=LONGEST)
    if process.returncode and not killed:
        raise RuntimeError(f"the sweep ended with code {process.returncode}.")
    return None if killed else json.loads(said)


def complete(path):
    """Share of the store's chunks that are complete, 0 before there is one."""
    try:
        group = zarr.open_group(str(path), mode="r", use_consolidated=False)
        return float(np.mean(np.asarray(group["done"][:])))
    except (FileNotFoundError, KeyError, ValueError):
        return 0.0


def one(path, model, starts, chunk):
    """What a run's process does; prints its peak memory and what it labelled."""
    count, labelling = int(starts), _batches.labelling_of(model)
    _batches.swept(labelling, min(count, COMPILED_BY))()
    found, seconds, _ = timed(_batches.swept(labelling, count, store=path, chunk=int(chunk)))
    # Kilobytes on Linux. Before the labels are read, which takes memory for all of them.
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    labels, differ = found["label"].values, None
    if count <= MOST_COMPARED:
        plain = _batches.swept(labelling, count)()["label"].values
        differ = int((labels != plain).sum())
    said = {
        "peak_mb": peak,
        "labelled": int(found.attrs["labelled_in_this_run"]),
        "sweep_s": seconds,
        "pending": int((labels == int(jb.basins.Label.PENDING)).sum()),
        "differ": differ,
    }
    print(json.dumps(said))


if __name__ == "__main__":
    one(*sys.argv[2:]) if sys.argv[1:2] == ["one"] else main()
