"""Methods of plain walks by lanes at equal error: steps, rejections and time against error.

Writes steps_tried.png. One thread; `JAXBIPED_LIMIT` may name a program to compare with, run as
`PROGRAM STARTS COUNT RTOL 1 1 1 ENDS` on files of 64-bit numbers, shape (8, count).
"""

import os

os.environ.setdefault("JAXBIPED_THREADS", "1")

import re
import resource
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from _options import Options, by, parse
from reference.compliant import START
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb

DURATION = 2.0
SOLVERS, QUICK_SOLVERS = ("rodas4", "rodas4p", "rodas5p", "rodas3p"), ("rodas4", "rodas4p")
TOLERANCES, QUICK_TOLERANCES = (2e-5, 1e-5, 5e-6, 1e-6, 3e-7, 1e-7), (1e-6,)
SPREADS = np.array([0.0, 0.0, 0.01, 0.01, 0.05, 0.05, 0.05, 0.05])
"""Standard deviations of the starts: angles [rad], velocities [m/s] and rates [rad/s]."""
ROUNDS = 5

Run: TypeAlias = Callable[[], tuple[np.ndarray, float, float, float]]
"""Final states (n, 8), CPU seconds, attempted steps of a walk, and the share rejected."""


def walking_starts(count: int) -> np.ndarray:
    """Perturbed starts (count, 8) that walk on for all the time."""
    noise = np.random.default_rng(0).standard_normal((2 * count + 8, 8))
    starts = START + SPREADS * noise
    walk = jax.vmap(
        lambda *y: (
            jb.simulate(
                jb.seed_scene(), jb.State(*y), duration=DURATION, save="end", engine="lanes"
            ).ending
        )
    )
    endings = np.asarray(walk(*map(jnp.asarray, starts.T)))
    return starts[endings == int(jb.Ending.WALKING)][:count]


def by_lanes(solver: str, rtol: float, starts: np.ndarray) -> Run:
    def one(*y: Any) -> Any:
        options: dict[str, Any] = dict(rtol=rtol, atol=1e-2 * rtol, save="end", engine="lanes")
        end = jb.simulate(
            jb.seed_scene(), jb.State(*y), duration=DURATION, solver=solver, **options
        )
        return end.final, end.attempted, end.rejected

    many, columns = jax.vmap(one), [jnp.asarray(column) for column in starts.T]

    def run() -> tuple[np.ndarray, float, float, float]:
        began = time.process_time()
        final, attempted, rejected = jax.block_until_ready(many(*columns))
        seconds = time.process_time() - began
        share = float(np.sum(rejected) / np.sum(attempted))
        return np.stack(final, axis=1), seconds, float(np.mean(attempted)), share

    return run


def by_limit(program: str, rtol: float, starts: np.ndarray) -> Run:
    """Another program's; it does not tell how many steps it rejected."""

    def run() -> tuple[np.ndarray, float, float, float]:
        with tempfile.TemporaryDirectory() as folder:
            given, found = Path(folder, "starts"), Path(folder, "ends")
            np.ascontiguousarray(starts.T).tofile(given)
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            command = [program, given, len(starts), rtol, 1, 1, 1, found]
            told = subprocess.run(
                [str(word) for word in command], capture_output=True, text=True, check=True
            ).stdout
            seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            steps = re.search(r"steps/sim ([\d.]+)", told)
            assert steps is not None, told
            ends = np.fromfile(found).reshape(8, -1).T
        return ends, seconds, float(steps.group(1)), float("nan")

    return run


def measured(runs: dict[tuple[str, float], Run], exact: np.ndarray) -> list[dict[str, Any]]:
    """Every way by turns; the median of its CPU times."""
    for run in runs.values():
        run()
    seconds: dict[tuple[str, float], list[float]] = {name: [] for name in runs}
    rows = {}
    for _ in range(ROUNDS):
        for name, run in runs.items():
            ends, spent, steps, rejected = run()
            seconds[name].append(spent)
            off = np.max(np.abs(ends[: len(exact)] - exact), axis=1)
            rows[name] = dict(way=name[0], rtol=name[1], error_median=float(np.median(off)),
                              steps=steps, rejected=rejected,
                              seconds=float(np.median(seconds[name])) / len(ends))  # fmt: skip
    return list(rows.values())


def picture(options: Options, rows: list[dict[str, Any]]) -> None:
    figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
    for way, picked in by("way", rows).items():
        errors = [row["error_median"] for row in picked]
        axes.loglog(errors, [1e6 * row["seconds"] for row in picked], "o-", label=way)
    axes.set_xlabel("median error of the final state (SI units)")
    axes.set_ylabel("CPU time of one walk in a batch [µs]")
    axes.grid(alpha=0.3)
    axes.legend()
    options.save(figure, "steps_tried.png")


def main() -> None:
    options = parse(__doc__ or "")
    starts = walking_starts(64 if options.quick else 2048)
    exact = np.stack(
        [final_of(DURATION, *FINEST, start=start) for start in starts[: 2 if options.quick else 64]]
    )
    solvers = QUICK_SOLVERS if options.quick else SOLVERS
    tolerances = QUICK_TOLERANCES if options.quick else TOLERANCES
    runs = {(s, rtol): by_lanes(s, rtol, starts) for s in solvers for rtol in tolerances}
    limit = os.environ.get("JAXBIPED_LIMIT", "")
    if limit:
        runs |= {("limit", rtol): by_limit(limit, rtol, starts) for rtol in tolerances}
    rows = measured(runs, exact)
    formats = dict(way="", rtol=".0e", error_median=".1e", steps=".0f", rejected=".3f")
    options.table(rows, **formats, seconds=".2e")
    picture(options, rows)
    options.finish({"duration_s": DURATION, "rows": rows})


if __name__ == "__main__":
    main()
