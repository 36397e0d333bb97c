"""Labelled starts a second by one worker process and by two, of one core each, into a store.

Writes process_scaling.png. Both take turns, and the best round of each counts: other work beside
takes cores away from them. Start-up and compiling are not counted.
"""

import os

os.environ["JAXBIPED_THREADS"] = "1"  # of each worker

import contextlib
import shutil

import _batches
import numpy as np
from _experiment import Options, experiment
from _pictures import label
from _timing import timed

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

STARTS, QUICK_STARTS = 100_000, 1024
CHUNK, QUICK_CHUNK = 2048, 128
ROUNDS, QUICK_ROUNDS = 5, 1
WORKERS = (1, 2)


@experiment
def main(options: Options):
    count, chunk = options.sized(STARTS, QUICK_STARTS), options.sized(CHUNK, QUICK_CHUNK)
    labelling, store = _batches.labelling_of("compliant"), options.path("process_scaling.zarr")
    rates, labels = {workers: [] for workers in WORKERS}, {}

    def swept(count, workers, pool):
        """A sweep into a fresh store, its seconds, and its labels."""
        shutil.rmtree(store, ignore_errors=True)
        how = dict(chunk=chunk, store=store, executor=pool, workers=workers)
        found, seconds, _ = timed(_batches.swept(labelling, count, **how))
        labels[workers] = np.asarray(found.label)
        shutil.rmtree(store)
        return seconds

    with contextlib.ExitStack() as stack:
        pools = {each: stack.enter_context(jb.local_executor(each)) for each in WORKERS}
        for workers, pool in pools.items():
            swept(2 * chunk * workers, workers, pool)
        for _ in range(options.sized(ROUNDS, QUICK_ROUNDS)):
            for workers, pool in pools.items():
                rates[workers].append(count / swept(count, workers, pool))
    rows = [
        dict(workers=workers, starts=count, chunk=chunk, starts_per_s=rates[workers],
             best=float(np.max(rates[workers])),
             labels_differ=int(np.sum(labels[workers] != labels[WORKERS[0]])))
        for workers in WORKERS
    ]  # fmt: skip
    efficiency = rows[1]["best"] / (2.0 * rows[0]["best"])
    return {"rows": rows, "efficiency": efficiency, "picture": draw(options, rows)}


def draw(options, rows):
    """Every round's rate beside that of as many times the rate of one worker."""
    figure = new_figure(5.0, 3.8)
    axes = figure.subplots()
    for row in rows:
        axes.plot([row["workers"]] * len(row["starts_per_s"]), row["starts_per_s"], "o", alpha=0.5)
    ideal = [rows[0]["best"] * workers for workers in WORKERS]
    axes.plot(WORKERS, ideal, "k--", label="linear")
    axes.plot(WORKERS, [row["best"] for row in rows], label="best")
    axes.set_xticks(WORKERS)
    label(axes, "worker processes of one core each", "labelled starts a second")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False)
    return options.save(figure, "process_scaling.png")


if __name__ == "__main__":
    main()
