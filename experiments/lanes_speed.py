"""The two engines and their peers on the seed's walk: batches, single walks, gaits, derivatives.

Writes lanes_speed.png. Everything is run in turns in one process, on two cores.
"""

# ruff: noqa: E402 (the cores are settled before JAX is imported)
import os

CORES = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
if CORES:
    os.sched_setaffinity(0, CORES[-2:])
os.environ.setdefault("NUMBA_NUM_THREADS", str(min(2, len(CORES) or 2)))

import functools
import time
from collections.abc import Callable
from typing import Any

import _casadi
import _lane_work
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from _batches import perturbed
from _options import Options, by, parse
from _timing import seconds_of
from reference.numbalsoda_solves import lsoda, lsoda_address, lsoda_batch
from reference.scipy_solves import FINEST, final_of

import jaxbiped as jb

DURATION = 2.0
CHECKED, QUICK_CHECKED = 8, 1
"""Lanes whose error is measured."""
SINGLES, QUICK_SINGLES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8), (1e-6,)
"""Tolerances of single walks."""
SLOPES, QUICK_SLOPES = (1e-6, 1e-7, 1e-8), (1e-6,)
"""Tolerances of walks with their derivatives."""
WAYS = {
    "lanes": ("lanes", "rodas4p"),
    "lanes, rodas4": ("lanes", "rodas4"),
    "xla": ("xla", "rodas4"),
}
"""Ours: the engine and the solver; walks go by `rodas4p` unless told otherwise."""
LANES = ("lanes", "lanes, rodas4")
TOLERANCES = {"lanes": 7e-6, "lanes, rodas4": 2e-6, "xla": 2e-6, "numbalsoda": 1e-7}
"""Of batches: those that give errors of about 2e-5."""


def options_of(way: str, rtol: float) -> dict[str, Any]:
    engine, solver = WAYS[way]
    return dict(rtol=rtol, atol=1e-2 * rtol, save="end", engine=engine, solver=solver)


def ours(way: str, rtol: float) -> Callable[[np.ndarray], tuple[np.ndarray, int]]:
    """Runs starts (n, 8): their final states, and attempted steps."""
    scene = jb.seed_scene()

    def one(*start: Any) -> Any:
        end = jb.simulate(scene, jb.State(*start), duration=DURATION, **options_of(way, rtol))
        return end.final, end.attempted

    many = jax.vmap(one) if way in LANES else jax.jit(jax.vmap(one))

    def run(starts: np.ndarray) -> tuple[np.ndarray, int]:
        finals, steps = jax.block_until_ready(many(*map(jnp.asarray, starts.T)))
        return np.stack(finals, axis=1), int(np.sum(steps))

    return run


def numbalsoda(rtol: float) -> Callable[[np.ndarray], tuple[np.ndarray, int]]:
    times, batch = np.array([0.0, DURATION]), lsoda_batch()
    return lambda starts: (batch(starts, times, rtol, 1e-2 * rtol), 0)


def batches(
    sizes: list[int], rounds: int, exact: np.ndarray, ways: tuple[str, ...]
) -> list[dict[str, Any]]:
    runners = {way: ours(way, TOLERANCES[way]) for way in ways}
    if lsoda_address() is not None:
        runners["numbalsoda"] = numbalsoda(TOLERANCES["numbalsoda"])
    rows = []
    for size in sizes:
        starts = perturbed(size)
        work = {n: lambda run=run, starts=starts: run(starts) for n, run in runners.items()}
        seconds = seconds_of(work, rounds)
        for name, run in runners.items():
            finals, steps = run(starts)
            checked = min(len(exact), len(finals))
            off = np.max(np.abs(finals[:checked] - exact[:checked]), axis=1)
            rows.append(
                dict(
                    way=name,
                    simulations=size,
                    rtol=TOLERANCES[name],
                    error_median=float(np.median(off)),
                    seconds=seconds[name],
                    simulations_per_s=size / seconds[name],
                    steps_per_s=steps / seconds[name] or None,
                )
            )
    return rows


def one_walk(way: str, rtol: float) -> Callable[[], np.ndarray]:
    """One walk from the seed's start: its final state."""

    def solve(state: jb.State) -> Any:
        end = jb.simulate(jb.seed_scene(), state, duration=DURATION, **options_of(way, rtol))
        return jnp.stack(end.final)

    program, state = jax.jit(solve), jb.seed_state()
    return lambda: np.asarray(program(state))


def singles(rounds: int, exact: np.ndarray, tolerances: tuple[float, ...]) -> list[dict[str, Any]]:
    """One walk at several tolerances; error against time."""
    work: dict[tuple[str, float], Callable[[], np.ndarray]] = {}
    for rtol in tolerances:
        for way in WAYS:
            work[way, rtol] = one_walk(way, rtol)
        if lsoda_address() is not None:
            atol = 1e-2 * rtol
            work["numbalsoda", rtol] = lambda r=rtol, a=atol: lsoda(DURATION, r, a)
        work["SciPy LSODA", rtol] = lambda r=rtol: final_of(DURATION, r, method="LSODA")
    seconds = seconds_of(work, rounds)  # type: ignore[arg-type]
    return [
        dict(way=way, rtol=rtol, error=float(np.max(np.abs(run() - exact))),
             seconds=seconds[way, rtol])  # type: ignore[index]
        for (way, rtol), run in work.items()
    ]  # fmt: skip


def first_result() -> float:
    """Seconds from a scene whose laws were not met before to its first result."""
    seed = jb.seed_scene()
    new = jb.Scene(
        walker=seed.walker,
        ground=seed.ground,
        normal=jb.laws.SmoothRistowSchafer(K=1e6, c=1e7),
        friction=seed.friction,
    )
    began = time.perf_counter()
    jb.simulate(new, jb.seed_state(), duration=0.1, save="end", engine="lanes").outcome  # noqa: B018
    return time.perf_counter() - began


def gaits(rounds: int, engines: tuple[str, ...]) -> tuple[dict[str, float], dict[str, float]]:
    """Warm seconds of a whole gait with all sensitivities, with and without the radius's.

    And the period of each [s].
    """
    periods: dict[str, float] = {}

    def find(name: str, engine: str, radius: bool) -> None:
        gait = jb.find_gait(jb.seed_scene(), engine=engine, radius_sensitivities=radius)
        jax.block_until_ready(gait.elasticities)
        periods[name] = float(gait.measures.period)

    work = {
        name: functools.partial(find, name, engine, radius)
        for engine in engines
        for radius in (False, True)
        for name in [f"{engine}, {'with' if radius else 'without'} the radius's"]
    }
    return seconds_of(work, rounds), periods


def derivatives(rounds: int, tolerances: tuple[float, ...]) -> list[dict[str, Any]]:
    """The final state and its derivatives in log K, log c and log ξ."""
    exact = _lane_work.final_slopes(DURATION, 1e-9)()[1]
    work = {
        (way, rtol): _lane_work.final_slopes(DURATION, rtol, solver=WAYS[way][1])
        for way in LANES
        for rtol in tolerances
    }
    if _casadi.is_installed():
        for rtol in tolerances:
            work["CasADi CVODES", rtol] = _casadi.sensitivities(DURATION, rtol)
    seconds = seconds_of(work, rounds)  # type: ignore[arg-type]
    return [
        dict(way=way, rtol=rtol, error=float(np.max(np.abs(run()[1] - exact))),
             seconds=seconds[way, rtol])  # type: ignore[index]
        for (way, rtol), run in work.items()
    ]  # fmt: skip


def picture(options: Options, rows: list[dict[str, Any]], alone: list[dict[str, Any]]) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for way, picked in by("way", rows).items():
        sizes = [row["simulations"] for row in picked]
        left.loglog(sizes, [row["simulations_per_s"] for row in picked], "o-", base=10, label=way)
    left.set_xlabel("simulations in the batch")
    left.set_ylabel(f"simulations of {DURATION:g} s a second")
    left.set_title("batches on two cores, errors of about 2e-5")
    for way, picked in by("way", alone).items():
        times = [1e3 * row["seconds"] for row in picked]
        right.loglog([row["error"] for row in picked], times, "o-", label=way)
    right.set_xlabel("largest error of the final state (SI units)")
    right.set_ylabel("time of one simulation [ms]")
    right.set_title("one walk")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    options.save(figure, "lanes_speed.png")


def report(options: Options, numbers: dict[str, Any]) -> None:
    options.table(
        numbers["batches"], way="", simulations="d", rtol=".0e", error_median=".0e",
        simulations_per_s=".0f", steps_per_s=".3g",
    )  # fmt: skip
    for title in ("singles", "derivatives"):
        options.say(f"\n{title}")
        options.table(numbers[title], way="", rtol=".0e", error=".0e", seconds=".2e")
    options.say()
    for name, seconds in numbers["gaits_s"].items():
        options.say(f"gait by {name:30}{1e3 * seconds:9.1f} ms")
    options.say(f"first result of a new scene: {numbers['first_result_s']:.2f} s")
    peak, used = numbers["peak_flops"], numbers["flops_per_step"]
    options.say(f"peak {peak / 1e9:.0f} GFLOP/s; a step has {used} floating-point operations")
    options.say(f"share of the peak reached: {numbers['share_of_peak']:.2f}")
    options.table(numbers["scenes"], scene="", instructions="d", steps_per_s=".3g")


def main() -> None:
    options = parse(__doc__ or "")
    rounds = 1 if options.quick else 5
    starts = perturbed(QUICK_CHECKED if options.quick else CHECKED)
    exact = np.stack([final_of(DURATION, *FINEST, start=start) for start in starts])
    sizes = [64] if options.quick else [8, 64, 512, 8192]
    # XLA's programs for batches and gaits compile for long: a quick version leaves them out.
    rows = batches(sizes, rounds, exact, LANES if options.quick else tuple(WAYS))
    levels = QUICK_SINGLES if options.quick else SINGLES
    alone = singles(rounds, final_of(DURATION, *FINEST), levels)
    slopes = derivatives(rounds, QUICK_SLOPES if options.quick else SLOPES)
    gaits_s, periods_s = gaits(rounds, ("lanes",) if options.quick else ("lanes", "xla"))
    peak, used = _lane_work.peak_flops(), _lane_work.flops_per_step()
    best = max(row["steps_per_s"] for row in rows if row["way"] == "lanes")
    numbers = {
        "duration_s": DURATION,
        "batches": rows,
        "singles": alone,
        "derivatives": slopes,
        "gaits_s": gaits_s,
        "gait_periods_s": periods_s,
        "first_result_s": first_result(),
        "peak_flops": peak,
        "flops_per_step": used,
        "share_of_peak": best * used / peak,
        "scenes": _lane_work.scenes(64 if options.quick else 4096, DURATION, quick=options.quick),
    }
    report(options, numbers)
    picture(options, rows, alone)
    options.finish(numbers)


if __name__ == "__main__":
    main()
