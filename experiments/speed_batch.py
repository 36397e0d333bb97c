"""Batches of perturbed starts on two cores: attempted steps and simulations a second.

Writes speed_batch.png.
"""

# ruff: noqa: E402 (the cores are settled before JAX is imported)
import _cores

_cores.settle(2)

import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, experiment
from _pictures import draw_by, label
from _timing import seconds_of, timed
from _walks import DURATION, errors_of, exact_ends, perturbed, walk_from
from reference.numbalsoda_solves import lsoda_address, lsoda_batch

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

TOLERANCES = (1e-4, 1e-6)
TILE = 256
WAYS = {"vmap": None, f"tiles of {TILE}": TILE}
SIZES, PEERS_SIZES, QUICK_SIZES = (64, 256, 1024, 4096), (64, 1024, 4096), (64,)
CHECKED, QUICK_CHECKED = 8, 1
"""Lanes whose error is measured."""


@experiment
def main(options: Options):
    tolerances = options.sized(TOLERANCES, TOLERANCES[:1])
    runs, compile_s = {}, {}
    for way in options.sized(list(WAYS), list(WAYS)[:1]):
        for lanes in options.sized(SIZES, QUICK_SIZES):
            if lanes > (WAYS[way] or 0):
                program, compile_s[f"{way}, {lanes} lanes"] = batch_program(lanes, WAYS[way])
                runs |= {(way, lanes, rtol): ours(program, lanes, rtol) for rtol in tolerances}
    missing = lsoda_address() is None
    for lanes in () if missing else options.sized(PEERS_SIZES, QUICK_SIZES):
        runs |= {("numbalsoda", lanes, rtol): numbalsoda(lanes, rtol) for rtol in tolerances}
    rows, finals = measured(runs)
    exact = exact_ends(perturbed(options.sized(CHECKED, QUICK_CHECKED)))
    return {
        "duration_s": DURATION,
        "compile_s": compile_s,
        "rows": rows,
        "errors": errors(runs, finals, exact),
        "numbalsoda": "not installed" if missing else "run",
        "picture": draw(options, rows),
    }


def batch_program(lanes, tile):
    """The compiled program for a batch, and the time [s] that compiling took."""

    def one(start, scene, rtol):
        end = walk_from(start, rtol, scene=scene)
        return end.final, end.attempted

    def many(starts, scene, rtol):
        all_lanes = jax.vmap(one, in_axes=(0, None, None))
        if tile is None:
            return all_lanes(starts, scene, rtol)
        tiles = tuple(leaf.reshape(-1, tile) for leaf in starts)
        finals, steps = jax.lax.map(lambda each: all_lanes(each, scene, rtol), tiles)
        return jax.tree.map(jnp.ravel, finals), steps.ravel()

    shape = tuple(jax.ShapeDtypeStruct((lanes,), float) for _ in range(8))
    return timed(lambda: jax.jit(many).lower(shape, jb.seed_scene(), 1e-6).compile())[:2]


def ours(program, lanes, rtol):
    """A batch made ready: gives final states (n, 8), and each lane's attempted steps."""
    starts = tuple(jnp.asarray(column) for column in perturbed(lanes).T)
    scene = jb.seed_scene()

    def run():
        finals, steps = jax.block_until_ready(program(starts, scene, jnp.asarray(rtol)))
        return np.stack(finals, axis=1), np.asarray(steps)

    return run


def numbalsoda(lanes, rtol):
    starts, times, batch = perturbed(lanes), np.array([0.0, DURATION]), lsoda_batch()
    return lambda: (batch(starts, times, rtol, 1e-2 * rtol), None)


def measured(runs):
    """Median times of runs that take turns, after one run each that does not count.

    Padded: if every lane took as many steps as the longest, which is what was computed. Failed:
    lanes that did not reach the end.
    """
    results = {name: run() for name, run in runs.items()}
    times = seconds_of(runs, 3, warm=False)
    rows = []
    for (way, lanes, rtol), (states, steps) in results.items():
        seconds = times[way, lanes, rtol]
        row = dict(way=way, lanes=lanes, rtol=rtol, seconds=seconds)
        row["steps_per_second"] = None if steps is None else float(steps.sum() / seconds)
        padded = None if steps is None else float(lanes * steps.max() / seconds)
        row |= dict(padded_steps_per_second=padded, simulations_per_second=lanes / seconds)
        rows.append(row | {"failed": int(np.sum(~np.isfinite(states).all(axis=1)))})
    return rows, {name: states for name, (states, _) in results.items()}


def errors(runs, finals, exact):
    """Largest and median error over a few lanes of the largest batches."""
    most = max(lanes for _, lanes, _ in runs)
    rows = []
    for (way, lanes, rtol), states in finals.items():
        if lanes == most:
            off = errors_of(states, exact)
            worst, middle = float(off.max()), float(np.median(off))
            rows.append(dict(way=way, rtol=rtol, largest=worst, median=middle))
    return rows


def draw(options, rows):
    figure = new_figure(7, 5)
    axes = figure.subplots()
    told = (
        row | {"words": f"{row['way']}, tolerance {row['rtol']:.0e}"}
        for row in rows
        if row["steps_per_second"]
    )
    draw_by(axes, "words", told, "lanes", "steps_per_second")
    axes.set_xscale("log", base=2)
    words = "simulations in the batch", "attempted steps a second, all lanes"
    label(axes, *words, f"{DURATION:g} s from perturbed starts on two cores")
    axes.set_ylim(bottom=0)
    axes.legend()
    return options.save(figure, "speed_batch.png")


if __name__ == "__main__":
    main()
