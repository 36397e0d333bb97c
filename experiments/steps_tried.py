"""Methods of plain walks by lanes at equal error: steps, rejections and time against error.

Writes steps_tried.png. One thread; `JAXBIPED_LIMIT` may name a program to compare with, run as
`PROGRAM STARTS COUNT RTOL 1 1 1 ENDS` on files of 64-bit numbers, shape (8, count).
"""

import os

os.environ.setdefault("JAXBIPED_THREADS", "1")

import functools
import re
import resource
import subprocess
import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _pictures import draw_by, label
from _timing import timed
from _walks import DURATION, errors_of, exact_ends, walker
from reference.compliant import START

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

SOLVERS, QUICK_SOLVERS = ("rodas4", "rodas4p", "rodas5p", "rodas3p"), ("rodas4", "rodas4p")
TOLERANCES, QUICK_TOLERANCES = (2e-5, 1e-5, 5e-6, 1e-6, 3e-7, 1e-7), (1e-6,)
SPREADS = np.array([0.0, 0.0, 0.01, 0.01, 0.05, 0.05, 0.05, 0.05])
"""Standard deviations of the starts: angles [rad], velocities [m/s] and rates [rad/s]."""
ROUNDS = 5


@experiment
def main(options: Options):
    starts = walking_starts(options.sized(2048, 64))
    exact = exact_ends(starts[: options.sized(64, 2)])
    tolerances = options.sized(TOLERANCES, QUICK_TOLERANCES)
    runs = {
        (solver, rtol): by_lanes(solver, rtol, starts)
        for solver in options.sized(SOLVERS, QUICK_SOLVERS)
        for rtol in tolerances
    }
    if limit := os.environ.get("JAXBIPED_LIMIT", ""):
        runs |= {("limit", r): functools.partial(by_limit, limit, r, starts) for r in tolerances}
    rows = measured(runs, exact)
    return {"duration_s": DURATION, "rows": rows, "picture": draw(options, rows)}


def walking_starts(count):
    """Perturbed starts (count, 8) that walk on for all the time."""
    noise = np.random.default_rng(0).standard_normal((2 * count + 8, 8))
    starts = START + SPREADS * noise
    how = dict(duration=DURATION, save="end", engine="lanes")
    walk = jax.vmap(lambda *y: jb.simulate(jb.seed_scene(), jb.State(*y), **how).ending)
    endings = np.asarray(walk(*map(jnp.asarray, starts.T)))
    return starts[endings == int(jb.Ending.WALKING)][:count]


def by_lanes(solver, rtol, starts):
    """A run: final states (n, 8), CPU seconds, attempted steps of a walk, the share rejected."""
    many = walker(rtol, solver=solver, engine="lanes")

    def run():
        (final, attempted, rejected), _, cpu = timed(lambda: many(starts))
        share = float(np.sum(rejected) / np.sum(attempted))
        return final, cpu, float(np.mean(attempted)), share

    return run


def by_limit(program, rtol, starts):
    """A run of another program; it does not tell how many steps it rejected."""
    with tempfile.TemporaryDirectory() as folder:
        given, found = Path(folder, "starts"), Path(folder, "ends")
        np.ascontiguousarray(starts.T).tofile(given)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        command = [str(word) for word in (program, given, len(starts), rtol, 1, 1, 1, found)]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        steps = re.search(r"steps/sim ([\d.]+)", told)
        assert steps is not None, told
        ends = np.fromfile(found).reshape(8, -1).T
    return ends, seconds, float(steps.group(1)), float("nan")


def measured(runs, exact):
    """Every way by turns; the median of its CPU times, after one run each that does not count."""
    for run in runs.values():
        run()
    rounds = [{name: run() for name, run in runs.items()} for _ in range(ROUNDS)]
    rows = []
    for (way, rtol), (ends, _, steps, rejected) in rounds[-1].items():
        seconds = float(np.median([found[way, rtol][1] for found in rounds])) / len(ends)
        row = dict(way=way, rtol=rtol, error_median=float(np.median(errors_of(ends, exact))))
        rows.append(row | dict(steps=steps, rejected=rejected, seconds=seconds))
    return rows


def draw(options, rows):
    figure = new_figure(6, 4.5)
    axes = figure.subplots()
    scaled = (row | {"us": 1e6 * row["seconds"]} for row in rows)
    draw_by(axes, "way", scaled, "error_median", "us")
    words = "median error of the final state (SI units)", "CPU time of one walk in a batch [µs]"
    label(axes, *words, log="xy")
    axes.legend()
    return options.save(figure, "steps_tried.png")


if __name__ == "__main__":
    main()
