"""Labelled starts a second by one worker process and by two, of one core each, into a store.

Writes process_scaling.png. Both take turns, and the best round of each counts: other work beside
takes cores away from them. Start-up and compiling are not counted.
"""

import os

os.environ["JAXBIPED_THREADS"] = "1"  # of each worker

import shutil
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import _batches
import numpy as np
from _options import Options, parse

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

STARTS, QUICK_STARTS = 100_000, 1024
CHUNK, QUICK_CHUNK = 2048, 128
ROUNDS, QUICK_ROUNDS = 5, 1
WORKERS = (1, 2)


def swept(
    labelling: jb.Labelling, count: int, chunk: int, folder: Path, executor: ProcessPoolExecutor,
    workers: int,
) -> tuple[float, np.ndarray]:  # fmt: skip
    """Seconds of a sweep into a fresh store, and its labels."""
    store = folder / "process_scaling.zarr"
    shutil.rmtree(store, ignore_errors=True)
    began = time.perf_counter()
    found = jb.sweep(
        labelling, _batches.starts_of(labelling.scene, count), chunk=chunk, look_for_gaits=False,
        store=store, executor=executor, workers=workers,
    )  # fmt: skip
    seconds = time.perf_counter() - began
    labels = np.asarray(found.label)
    shutil.rmtree(store)
    return seconds, labels


def measured(options: Options) -> list[dict[str, Any]]:
    """For each number of workers the starts a second of all rounds."""
    quick = options.quick
    count, chunk = (QUICK_STARTS, QUICK_CHUNK) if quick else (STARTS, CHUNK)
    labelling = _batches.labelling_of("compliant")
    folder = options.path("process_scaling.png").parent
    pools = {workers: jb.local_executor(workers) for workers in WORKERS}
    rates: dict[int, list[float]] = {workers: [] for workers in WORKERS}
    labels: dict[int, np.ndarray] = {}
    try:
        for workers, pool in pools.items():
            swept(labelling, 2 * chunk * workers, chunk, folder, pool, workers)
        for _ in range(QUICK_ROUNDS if quick else ROUNDS):
            for workers, pool in pools.items():
                seconds, labels[workers] = swept(labelling, count, chunk, folder, pool, workers)
                rates[workers].append(count / seconds)
    finally:
        for pool in pools.values():
            pool.shutdown()
    return [
        dict(workers=workers, starts=count, chunk=chunk, starts_per_s=rates[workers],
             best=float(np.max(rates[workers])),
             labels_differ=int(np.sum(labels[workers] != labels[WORKERS[0]])))
        for workers in WORKERS
    ]  # fmt: skip


def picture(options: Options, rows: list[dict[str, Any]]) -> None:
    """Every round's rate beside that of as many times the rate of one worker."""
    figure = new_figure(5.0, 3.8)
    axes = figure.subplots()
    for row in rows:
        axes.plot([row["workers"]] * len(row["starts_per_s"]), row["starts_per_s"], "o", alpha=0.5)
    ideal = [rows[0]["best"] * row["workers"] for row in rows]
    axes.plot([row["workers"] for row in rows], ideal, "k--", label="linear")
    axes.plot([row["workers"] for row in rows], [row["best"] for row in rows], label="best")
    axes.set_xticks([row["workers"] for row in rows])
    axes.set_xlabel("worker processes of one core each")
    axes.set_ylabel("labelled starts a second")
    axes.set_ylim(bottom=0.0)
    axes.grid(color="#DDDDDD")
    axes.legend(frameon=False)
    options.save(figure, "process_scaling.png")


def main() -> None:
    options = parse(__doc__ or "")
    rows = measured(options)
    efficiency = rows[1]["best"] / (2.0 * rows[0]["best"])
    options.table(rows, workers="d", best=".0f", labels_differ="d")
    options.say(f"two workers are {efficiency:.1%} of linear")
    picture(options, rows)
    options.finish({"rows": rows, "efficiency": efficiency})


if __name__ == "__main__":
    main()
