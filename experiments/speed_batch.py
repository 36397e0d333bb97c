"""Batches of perturbed starts on two cores: attempted steps and simulations a second.

Writes speed_batch.png.
"""

# ruff: noqa: E402 (the cores are settled before JAX is imported)
import os

CORES = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
if CORES:
    os.sched_setaffinity(0, CORES[-2:])
os.environ.setdefault("NUMBA_NUM_THREADS", str(min(2, len(CORES) or 2)))

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from _batches import perturbed
from _options import Options, parse
from _timing import seconds_of
from reference.numbalsoda_solves import lsoda_address, lsoda_batch
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb

DURATION = 2.0
TOLERANCES = (1e-4, 1e-6)
TILE = 256
WAYS = {"vmap": None, f"tiles of {TILE}": TILE}
CHECKED, QUICK_CHECKED = 8, 1
"""Lanes whose error is measured."""


class Row(NamedTuple):
    """What one way of running a batch did."""

    way: str
    lanes: int
    rtol: float
    seconds: float
    steps_per_second: float | None
    """Attempted steps of all lanes."""
    padded_steps_per_second: float | None
    """The same if every lane took as many as the longest: what was computed."""
    simulations_per_second: float
    failed: int
    """Lanes that did not reach the end."""


class Runner(NamedTuple):
    """A batch made ready: `run()` gives final states (n, 8), and each lane's attempted steps."""

    way: str
    lanes: int
    rtol: float
    run: Callable[[], tuple[Any, Any]]


def batch_program(lanes: int, tile: int | None) -> tuple[Any, float]:
    """The compiled program for a batch, and the time [s] that compiling took."""

    def one(start: Any, scene: jb.Scene, rtol: Any) -> tuple[Any, Any]:
        options: dict[str, Any] = dict(rtol=rtol, atol=1e-2 * rtol, save="end")
        end = jb.simulate(scene, jb.State(*start), duration=DURATION, **options)
        return end.final, end.attempted

    def many(starts: Any, scene: jb.Scene, rtol: Any) -> tuple[Any, Any]:
        all_lanes = jax.vmap(one, in_axes=(0, None, None))
        if tile is None:
            return all_lanes(starts, scene, rtol)
        tiles = tuple(leaf.reshape(-1, tile) for leaf in starts)
        finals, steps = jax.lax.map(lambda each: all_lanes(each, scene, rtol), tiles)
        return jax.tree.map(jnp.ravel, finals), steps.ravel()

    shape = tuple(jax.ShapeDtypeStruct((lanes,), float) for _ in range(8))
    began = time.perf_counter()
    program = jax.jit(many).lower(shape, jb.seed_scene(), 1e-6).compile()
    return program, time.perf_counter() - began


def ours(way: str, lanes: int, program: Any) -> list[Runner]:
    starts = tuple(jnp.asarray(column) for column in perturbed(lanes).T)
    scene = jb.seed_scene()

    def runner(rtol: float) -> Runner:
        def run() -> tuple[Any, Any]:
            finals, steps = jax.block_until_ready(program(starts, scene, jnp.asarray(rtol)))
            return np.stack(finals, axis=1), np.asarray(steps)

        return Runner(way, lanes, rtol, run)

    return [runner(rtol) for rtol in TOLERANCES]


def numbalsoda(lanes: int) -> list[Runner]:
    starts, times = perturbed(lanes), np.array([0.0, DURATION])

    def runner(rtol: float) -> Runner:
        batch = lsoda_batch()
        return Runner(
            "numbalsoda", lanes, rtol, lambda: (batch(starts, times, rtol, 1e-2 * rtol), None)
        )

    return [runner(rtol) for rtol in TOLERANCES]


def runners(quick: bool) -> tuple[list[Runner], dict[str, float]]:
    """Everything to run, and the seconds that compiling each of our programs took."""
    found: list[Runner] = []
    compile_seconds = {}
    for way, tile in list(WAYS.items())[: 1 if quick else None]:
        for lanes in (64,) if quick else (64, 256, 1024, 4096):
            if tile is not None and lanes <= tile:
                continue
            program, seconds = batch_program(lanes, tile)
            compile_seconds[f"{way}, {lanes} lanes"] = seconds
            found += ours(way, lanes, program)
    if lsoda_address() is not None:
        for lanes in (64,) if quick else (64, 1024, 4096):
            found += numbalsoda(lanes)
    return [r for r in found if not quick or r.rtol == TOLERANCES[0]], compile_seconds


def measured(found: list[Runner], rounds: int) -> tuple[list[Row], list[np.ndarray]]:
    """Median times of runs that take turns, after one run each that does not count."""
    results = [runner.run() for runner in found]
    times = seconds_of(dict(enumerate(runner.run for runner in found)), rounds, warm=False)
    rows = []
    for runner, (states, steps), seconds in zip(found, results, times.values(), strict=True):
        rows.append(
            Row(
                runner.way,
                runner.lanes,
                runner.rtol,
                float(seconds),
                None if steps is None else float(steps.sum() / seconds),
                None if steps is None else float(runner.lanes * steps.max() / seconds),
                float(runner.lanes / seconds),
                int(np.sum(~np.isfinite(states).all(axis=1))),
            )
        )
    return rows, [states for states, _ in results]


def errors(found: list[Runner], finals: list[np.ndarray], checked: int) -> list[dict[str, Any]]:
    """Largest and median error over a few lanes of the largest batches."""
    lanes = max(runner.lanes for runner in found)
    exact = np.stack([final_of(DURATION, *FINEST, start=start) for start in perturbed(checked)])
    rows = []
    for runner, states in zip(found, finals, strict=True):
        if runner.lanes == lanes:
            off = np.max(np.abs(states[:checked] - exact), axis=1)
            worst, middle = float(off.max()), float(np.median(off))
            rows.append(dict(way=runner.way, rtol=runner.rtol, largest=worst, median=middle))
    return rows


def picture(options: Options, rows: list[Row]) -> None:
    figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
    for way in dict.fromkeys(row.way for row in rows if row.steps_per_second):
        for rtol in TOLERANCES:
            picked = [row for row in rows if row.way == way and row.rtol == rtol]
            lanes = [row.lanes for row in picked]
            rates = [row.steps_per_second for row in picked]
            style = "o-" if way == "vmap" else "s--"
            if picked:
                axes.semilogx(lanes, rates, style, base=2, label=f"{way}, tolerance {rtol:.0e}")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("simulations in the batch")
    axes.set_ylabel("attempted steps a second, all lanes")
    axes.set_title(f"{DURATION:g} s from perturbed starts on two cores")
    axes.grid(alpha=0.3)
    axes.legend()
    options.save(figure, "speed_batch.png")


def report(options: Options, rows: list[Row], off: list[dict[str, Any]], checked: int) -> None:
    options.table(
        rows, way="", lanes="d", rtol=".0e", seconds=".3f", steps_per_second=".3g",
        padded_steps_per_second=".3g", simulations_per_second=".0f", failed="d",
    )  # fmt: skip
    if lsoda_address() is None:
        options.say("numbalsoda: not installed")
    options.say(f"\nError of {checked} lanes against Radau at 1e-11")
    options.table(off, way="", rtol=".0e", median=".1e", largest=".1e")


def main() -> None:
    options = parse(__doc__ or "")
    found, compile_seconds = runners(options.quick)
    rows, finals = measured(found, 3)
    checked = QUICK_CHECKED if options.quick else CHECKED
    off = errors(found, finals, checked)
    report(options, rows, off, checked)
    picture(options, rows)
    options.finish(
        {
            "duration_s": DURATION,
            "compile_s": compile_seconds,
            "rows": [row._asdict() for row in rows],
            "errors": off,
            "numbalsoda": "not installed" if lsoda_address() is None else "run",
        }
    )


if __name__ == "__main__":
    main()
