"""Sweeps into a Zarr store, some by processes that are killed on the way: time, memory, labels.

Each run is a process of its own; what was complete when it was killed is not computed again. What a
start costs is measured without the process's own start and its compiling.
"""

import dataclasses
import json
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import _batches
import numpy as np
import zarr
from _options import Options, parse

import jaxbiped as jb

CHUNK = 16384
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
    chunk: int = CHUNK


JOBS = (
    Job("rigid", 10_000, ()),
    Job("rigid", 1_000_000, ()),
    Job("rigid", 1_000_000, (0.3, 0.6)),
    Job("compliant", 100_000, (0.3, 0.6)),
    *(Job("compliant", 10**power, ()) for power in range(3, 8)),
)
QUICK_JOBS = (Job("rigid", 2000, (0.3,), chunk=100),)


def main() -> None:
    if len(sys.argv) > 1 and sys.argv[1] == "one":
        one(*sys.argv[2:])
        return
    options = parse(__doc__ or "")
    jobs = QUICK_JOBS if options.quick else JOBS
    runs = [done(options, job) for job in jobs]
    formats = dict(model="", starts="d", killed="d", labelled_in_last_run="d", seconds=".1f")
    options.table(runs, **formats, us_a_start=".1f", peak_mb=".0f")
    options.finish({"runs": runs})


def done(options: Options, job: Job) -> dict[str, Any]:
    """A job's runs, one after another in the same store, and whether the labels are right."""
    path = options.path(f"{job.model}-{job.starts}-{len(job.kills)}.zarr")
    shutil.rmtree(path, ignore_errors=True)
    runs = [run(path, job, kill) for kill in (*job.kills, None)]
    last = runs[-1]
    seconds = sum(each["seconds"] for each in runs)
    return {
        **dataclasses.asdict(job),
        "killed": sum(each["killed"] for each in runs),
        "seconds": seconds,
        "us_a_start": 1e6 * last["sweep_s"] / last["labelled"],
        "peak_mb": last["peak_mb"],
        "labelled_in_last_run": last["labelled"],
        "pending": last["pending"],
        "differ_from_memory": last["differ"],
    }


def run(path: Path, job: Job, kill: float | None) -> dict[str, Any]:
    """One process on the store, killed when this share of the chunks is complete."""
    command = [sys.executable, __file__, "one", str(path), job.model, str(job.starts)]
    began = time.perf_counter()
    process = subprocess.Popen([*command, str(job.chunk)], stdout=subprocess.PIPE, text=True)
    killed = kill is not None and killed_at(process, path, kill)
    said, _ = process.communicate(timeout=LONGEST)
    seconds = time.perf_counter() - began
    if killed:
        return {"killed": True, "seconds": seconds}
    if process.returncode:
        raise RuntimeError(f"the sweep ended with code {process.returncode}.")
    return {"killed": False, "seconds": seconds, **json.loads(said)}


def killed_at(process: subprocess.Popen[str], path: Path, share: float) -> bool:
    """Kills the process once so much is complete; False where it came to its end before."""
    while process.poll() is None:
        if complete(path) >= share:
            process.kill()
            return True
        time.sleep(0.002)
    return False


def complete(path: Path) -> float:
    """Share of the store's chunks that are complete, 0 before there is one."""
    try:
        group = zarr.open_group(str(path), mode="r", use_consolidated=False)
        return float(np.mean(np.asarray(group["done"][:])))
    except (FileNotFoundError, KeyError, ValueError):
        return 0.0


def one(path: str, model: str, starts: str, chunk: str) -> None:
    """What a run's process does; prints its peak memory and what it labelled."""
    labelling = _batches.labelling_of(model)
    _batches.swept(labelling, min(int(starts), COMPILED_BY))()
    began = time.perf_counter()
    found = jb.sweep(
        labelling,
        _batches.starts_of(labelling.scene, int(starts)),
        store=path,
        chunk=int(chunk),
        look_for_gaits=False,
    )
    seconds = time.perf_counter() - began
    labelled = int(found.attrs["labelled_in_this_run"])
    # Kilobytes on Linux. Before the labels are read, which takes memory for all of them.
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    said: dict[str, Any] = {"peak_mb": peak, "labelled": labelled, "sweep_s": seconds}
    stored = found["label"].values
    said["pending"] = int((stored == int(jb.basins.Label.PENDING)).sum())
    said["differ"] = None
    if int(starts) <= MOST_COMPARED:
        plain = _batches.swept(labelling, int(starts))()["label"].values
        said["differ"] = int((stored != plain).sum())
    print(json.dumps(said))


if __name__ == "__main__":
    main()
