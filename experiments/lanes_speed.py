"""The two engines and their peers on the seed's walk: batches, single walks, gaits, derivatives.

Writes lanes_speed.png. Everything is run in turns in one process, on two cores.
"""

# ruff: noqa: E402 (the cores are settled before JAX is imported)
import _cores

_cores.settle(2)

import functools
import itertools

import _casadi
import jax
import jax.numpy as jnp
import numpy as np
from _experiment import Options, draw_by, experiment, label
from _scenes import seed_with
from _timing import seconds_of, timed
from _walks import DURATION, errors_of, exact_ends, perturbed, slopes_and_end, walk_from, walker
from reference.numbalsoda_solves import lsoda, lsoda_address, lsoda_batch
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

CHECKED, QUICK_CHECKED = 8, 1
"""Lanes whose error is measured."""
SINGLES, QUICK_SINGLES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8), (1e-6,)
"""Tolerances of single walks."""
SLOPES, QUICK_SLOPES = (1e-6, 1e-7, 1e-8), (1e-6,)
"""Tolerances of walks with their derivatives."""
SIZES, QUICK_SIZES = (8, 64, 512, 8192), (64,)
WAYS = {
    "lanes": dict(engine="lanes", solver="rodas4p"),
    "lanes, rodas4": dict(engine="lanes", solver="rodas4"),
    "xla": dict(engine="xla", solver="rodas4"),
}
"""Ours: the engine and the solver; walks go by `rodas4p` unless told otherwise."""
LANES = ("lanes", "lanes, rodas4")
TOLERANCES = {"lanes": 7e-6, "lanes, rodas4": 2e-6, "xla": 2e-6, "numbalsoda": 1e-7}
"""Of batches: those that give errors of about 2e-5."""


@experiment
def main(options: Options):
    rounds = options.sized(5, 1)
    exact = exact_ends(perturbed(options.sized(CHECKED, QUICK_CHECKED)))
    # XLA's programs for batches and gaits compile for long: a quick version leaves them out.
    rows = batches(options.sized(SIZES, QUICK_SIZES), rounds, exact, options.sized(WAYS, LANES))
    alone = singles(options.sized(SINGLES, QUICK_SINGLES), rounds)
    gaits_s, periods_s = gaits(options.sized(("lanes", "xla"), ("lanes",)), rounds)
    return {
        "duration_s": DURATION,
        "batches": rows,
        "singles": alone,
        "derivatives": derivatives(options.sized(SLOPES, QUICK_SLOPES), rounds),
        "gaits_s": gaits_s,
        "gait_periods_s": periods_s,
        "first_result_s": first_result(),
        "picture": draw(options, rows, alone),
    }


def batches(sizes, rounds, exact, ways):
    runners = {way: walker(TOLERANCES[way], **WAYS[way]) for way in ways}
    if lsoda_address() is not None:
        times, batch, rtol = np.array([0.0, DURATION]), lsoda_batch(), TOLERANCES["numbalsoda"]
        runners["numbalsoda"] = lambda starts: (batch(starts, times, rtol, 1e-2 * rtol), 0)
    rows = []
    for size in sizes:
        starts = perturbed(size)
        seconds = seconds_of({n: functools.partial(r, starts) for n, r in runners.items()}, rounds)
        for name, run in runners.items():
            finals, attempted, *_ = run(starts)
            median = float(np.median(errors_of(finals, exact[:size])))
            row = dict(way=name, simulations=size, rtol=TOLERANCES[name], error_median=median)
            row |= dict(seconds=seconds[name], simulations_per_s=size / seconds[name])
            rows.append(row | {"steps_per_s": int(np.sum(attempted)) / seconds[name] or None})
    return rows


def compared(work, rounds, exact):
    """Time and error of runs by way and tolerance."""
    seconds = seconds_of(work, rounds)
    return [
        dict(way=way, rtol=rtol, error=float(np.max(np.abs(run() - exact))),
             seconds=seconds[way, rtol])
        for (way, rtol), run in work.items()
    ]  # fmt: skip


def singles(tolerances, rounds):
    """One walk from the seed's start at several tolerances; error against time."""
    work = {}
    for rtol in tolerances:
        for way, how in WAYS.items():
            work[way, rtol] = one_walk(rtol, how)
        if lsoda_address() is not None:
            work["numbalsoda", rtol] = functools.partial(lsoda, DURATION, rtol, 1e-2 * rtol)
        work["SciPy LSODA", rtol] = functools.partial(final_of, DURATION, rtol, method="LSODA")
    return compared(work, rounds, final_of(DURATION, *FINEST))


def one_walk(rtol, how):
    """One walk from the seed's start: its final state."""
    program = jax.jit(lambda state: jnp.stack(walk_from(state, rtol, **how).final))
    return lambda: np.asarray(program(jb.seed_state()))


def first_result():
    """Seconds from a scene whose laws were not met before to its first result."""
    scene = seed_with("smooth-ristow-schafer")
    how = dict(duration=0.1, save="end", engine="lanes")
    return timed(lambda: jb.simulate(scene, jb.seed_state(), **how).outcome)[1]


def gaits(engines, rounds):
    """Warm seconds of a whole gait with all sensitivities, with and without the radius's.

    And the period of each [s].
    """
    periods = {}

    def find(name, engine, radius):
        gait = jb.find_gait(jb.seed_scene(), engine=engine, radius_sensitivities=radius)
        jax.block_until_ready(gait.elasticities)
        periods[name] = float(gait.measures.period)

    work = {}
    for engine, radius in itertools.product(engines, (False, True)):
        name = f"{engine}, {'with' if radius else 'without'} the radius's"
        work[name] = functools.partial(find, name, engine, radius)
    return seconds_of(work, rounds), periods


def derivatives(tolerances, rounds):
    """The final state and its derivatives in log K, log c and log ξ."""

    def slopes(rtol, solver="rodas4"):
        run = slopes_and_end(DURATION, solver=solver, engine="lanes")
        return lambda: run(rtol)[0]

    work = {(way, rtol): slopes(rtol, WAYS[way]["solver"]) for way in LANES for rtol in tolerances}
    for rtol in tolerances if _casadi.is_installed() else ():
        both = _casadi.sensitivities(DURATION, rtol)
        work["CasADi CVODES", rtol] = lambda both=both: both()[1]
    return compared(work, rounds, slopes(1e-9)())


def draw(options, rows, alone):
    left, right = new_figure(11, 4.5).subplots(1, 2)
    draw_by(left, "way", rows, "simulations", "simulations_per_s")
    words = "simulations in the batch", f"simulations of {DURATION:g} s a second"
    label(left, *words, "batches on two cores, errors of about 2e-5", log="xy")
    draw_by(right, "way", (row | {"ms": 1e3 * row["seconds"]} for row in alone), "error", "ms")
    words = "largest error of the final state (SI units)", "time of one simulation (ms)"
    label(right, *words, "one walk", log="xy")
    for axes in (left, right):
        axes.legend()
    return options.save(left.figure, "lanes_speed.png")


if __name__ == "__main__":
    main()
