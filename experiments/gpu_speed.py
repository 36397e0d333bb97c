"""CUDA devices: registers and spills of programs; where there is one, what it computes a second.

Steps and labelled starts a second against the size of the batch, beside lanes on this CPU and XLA
where JAX computes on the same device, the share of the device's measured peak, and errors. Where
there is no device nothing runs on one, and it says so. Writes gpu_speed.png where there is one.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import _ptxas
import jax
import jax.numpy as jnp
import numpy as np
from _options import Options, parse
from _timing import seconds_of

import jaxbiped as jb
from jaxbiped.compiler import CUDA, DEVICES, Program, Request
from jaxbiped.plot.style import new_figure

SIZES, QUICK_SIZES = (1000, 10_000, 100_000, 1_000_000), (4,)
MOST_BY_LANES = 100_000
"""Starts that lanes and XLA take, too."""
DURATION, QUICK_DURATION = 2.0, 0.05
TOLERANCES, QUICK_TOLERANCES = (1e-4, 1e-5, 1e-6), (1e-4,)
ROUNDS, QUICK_ROUNDS = 5, 1
"""Runs of which the median counts."""
CHAINS, TURNS = 8, 512
"""Multiply-adds of the peak's kernel: beside each other, and one behind the other in an attempt."""


def main() -> None:
    options = parse(__doc__ or "")
    quick = options.quick
    assembled = registers(options)
    missing = DEVICES.hindrance()
    numbers: dict[str, Any] = {"assembled": assembled, "missing": missing, "devices": []}
    if missing is not None:
        options.say(f"\nNothing ran on a device: {missing}.")
        options.finish(numbers)
        return
    numbers["devices"] = DEVICES.names()
    options.say(f"\ndevices: {', '.join(DEVICES.names())}")
    sizes, rounds = (QUICK_SIZES, QUICK_ROUNDS) if quick else (SIZES, ROUNDS)
    numbers["peak_flops"] = peak(64 if quick else 1 << 20, 4 if quick else 200, rounds)
    options.say(f"multiply-adds: {numbers['peak_flops']:.3g} operations a second")
    numbers["walks"] = walks(options, sizes, QUICK_DURATION if quick else DURATION, rounds)
    share = field_operations() * numbers["walks"][-1]["cuda_steps_per_s"]
    numbers["share_of_peak"] = share / numbers["peak_flops"]
    options.say(f"share of the peak, the fields' operations alone: {numbers['share_of_peak']:.1%}")
    numbers["errors"] = errors(options, QUICK_TOLERANCES if quick else TOLERANCES, sizes[0])
    numbers["labels"] = labels(options, sizes, 1 if quick else 30, rounds)
    draw(options, numbers)
    options.finish(numbers)


def registers(options: Options) -> list[dict[str, Any]]:
    """What the assembler says of each program."""
    kinds = ("sm_90",) if options.quick else ("sm_80", "sm_90", "sm_100")
    rows = list(_ptxas.rows(kinds, _ptxas.BOUNDS[:1] if options.quick else _ptxas.BOUNDS))
    options.table(
        rows, program="", architecture="", blocks="d", registers="d", spill_stores="d",
        spill_loads="d", warps="d",
    )  # fmt: skip
    return rows


def peak(count: int, attempts: int, rounds: int) -> float:
    """Operations of multiply-adds a second, two each."""

    def attempt(inputs: Any, now: Any) -> Any:
        numbers, turns = now

        def turn(_: Any, chains: Any) -> Any:
            return tuple(x * inputs[0] + inputs[1] for x in chains)

        numbers = jax.lax.fori_loop(0, TURNS, turn, numbers)
        return (numbers, turns + 1.0), turns + 1.0 >= inputs[2]

    program = Program(
        start=lambda inputs: (tuple([inputs[0] + k for k in range(CHAINS)]), jnp.zeros(())),
        attempt=attempt,
        finish=lambda inputs, now: sum(now[0]),
    )
    inputs = tuple(np.full(count, value) for value in (0.999, 1e-3, float(attempts)))
    request = Request(program, inputs, batch=True)
    seconds = seconds_of({0: lambda: CUDA.run(request)}, rounds)[0]
    return 2.0 * count * attempts * CHAINS * TURNS / seconds


def perturbed(count: int) -> jb.State:
    """Starts about the seed's, every number off by about a thousandth of itself."""
    noise = 1.0 + 1e-3 * np.random.default_rng(0).standard_normal((8, count))
    return jb.State(*map(jnp.asarray, np.array([*jb.seed_state()])[:, None] * noise))


def walker(engine: str, duration: float, rtol: float = 2e-6) -> Callable[[jb.State], Any]:
    """Walks starts: their final states, and attempted steps."""
    scene = jb.seed_scene()

    def one(state: jb.State) -> Any:
        how: Any = dict(rtol=rtol, atol=1e-2 * rtol, save="end", engine=engine)
        end = jb.simulate(scene, state, duration=duration, **how)
        return end.final, end.attempted

    many = jax.jit(jax.vmap(one))
    return lambda states: jax.block_until_ready(many(states))


def walks(
    options: Options, sizes: tuple[int, ...], duration: float, rounds: int
) -> list[dict[str, Any]]:
    """Attempted steps a second by each engine."""
    engines = ["cuda", "lanes", *(["xla"] if jax.default_backend() == "gpu" else [])]
    rows = []
    for size in sizes:
        starts, row = perturbed(size), dict[str, Any](size=size)
        for engine in engines if size <= MOST_BY_LANES else engines[:1]:
            run = walker(engine, duration)
            steps = float(np.sum(run(starts)[1]))
            row[f"{engine}_steps_per_s"] = steps / seconds_of({0: partial(run, starts)}, rounds)[0]
        rows.append(row)
    options.table(rows, size="d", **{f"{engine}_steps_per_s": ".4g" for engine in engines})
    return rows


def field_operations() -> int:
    """Of the vector field in a step of "rodas4", which asks for it six times."""
    return 6 * sum(jb.measure.operation_counts(jb.seed_scene()).values())


def errors(options: Options, tolerances: tuple[float, ...], size: int) -> list[dict[str, Any]]:
    """Median error of final states against a tight solve, and how many are the lanes' bits."""
    starts, rows = perturbed(size), []
    truth = np.array(walker("lanes", QUICK_DURATION, 1e-9)(starts)[0])
    for rtol in tolerances:
        found, ours = (
            np.array(walker(engine, QUICK_DURATION, rtol)(starts)[0])
            for engine in ("cuda", "lanes")
        )
        error = float(np.median(np.abs(found - truth).max(axis=0)))
        same = float(np.mean(np.all(found == ours, axis=0)))
        rows.append({"rtol": rtol, "error": error, "same_bits": same})
    options.table(rows, rtol=".0e", error=".1e", same_bits=".3f")
    return rows


def labels(
    options: Options, sizes: tuple[int, ...], footsteps: int, rounds: int
) -> list[dict[str, Any]]:
    """Labelled starts of the seed's slice a second, and how many labels are the lanes'."""
    cuda, lanes = (
        jb.labelling(jb.seed_scene(), footsteps=footsteps, engine=engine)
        for engine in ("cuda", "lanes")
    )
    rows = []
    for size in sizes:
        ranges = {"omega_swing": (-4.0, 5.0), "theta_swing": (-0.5, 0.8)}
        states = jb.starts.sample(cuda.scene, ranges, size).batch(cuda, 0, size).states
        row: dict[str, Any] = {"size": size}
        row["cuda_starts_per_s"] = size / seconds_of({0: partial(cuda, states)}, rounds)[0]
        if size <= MOST_BY_LANES:
            row["lanes_starts_per_s"] = size / seconds_of({0: partial(lanes, states)}, rounds)[0]
            differ = cuda(states).label != lanes(states).label
            row["labels_that_differ"] = int(np.sum(differ))
        rows.append(row)
    formats = dict(size="d", cuda_starts_per_s=".0f", lanes_starts_per_s=".0f")
    options.table(rows, **formats, labels_that_differ="d")
    return rows


def draw(options: Options, numbers: dict[str, Any]) -> None:
    """Steps a second against the size of the batch."""
    figure = new_figure(6.0, 4.0)
    ax = figure.subplots()
    for engine in ("cuda", "lanes", "xla"):
        key = f"{engine}_steps_per_s"
        rows = [row for row in numbers["walks"] if key in row]
        if rows:
            ax.loglog([r["size"] for r in rows], [r[key] for r in rows], "o-", label=engine)
    ax.set_xlabel("starts in the batch")
    ax.set_ylabel("attempted steps a second")
    ax.legend()
    options.save(figure, "gpu_speed.png")


if __name__ == "__main__":
    main()
