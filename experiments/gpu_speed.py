"""CUDA devices: registers and spills of programs; where there is one, what it computes a second.

Steps and labelled starts a second against the size of the batch, beside lanes on this CPU and XLA
where JAX computes on the same device, the share of the device's measured peak, and errors. Where
there is no device nothing runs on one, and it says so. Writes gpu_speed.png where there is one.
"""

from functools import partial

import _ptxas
import jax
import jax.numpy as jnp
import numpy as np
from _batches import OMEGA, THETA
from _experiment import Options, experiment, label
from _timing import seconds_of
from _walks import errors_of, perturbed, walker

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
PEAK, QUICK_PEAK = (1 << 20, 200), (64, 4)
"""Threads of the peak's kernel, and attempts of each."""
CHAINS, TURNS = 8, 512
"""Multiply-adds of it: beside each other, and one behind the other in an attempt."""


@experiment
def main(options: Options):
    kinds = options.sized(("sm_80", "sm_90", "sm_100"), ("sm_90",))
    assembled = list(_ptxas.rows(kinds, options.sized(_ptxas.BOUNDS, _ptxas.BOUNDS[:1])))
    missing = DEVICES.hindrance()
    numbers = {"assembled": assembled, "missing": missing, "devices": []}
    if missing is not None:
        return numbers
    sizes, rounds = options.sized(SIZES, QUICK_SIZES), options.sized(ROUNDS, QUICK_ROUNDS)
    speed = peak(*options.sized(PEAK, QUICK_PEAK), rounds)
    walked = walks(sizes, options.sized(DURATION, QUICK_DURATION), rounds)
    # The fields' operations alone, for which "rodas4" asks six times in a step.
    operations = 6 * sum(jb.measure.operation_counts(jb.seed_scene()).values())
    return numbers | {
        "devices": DEVICES.names(),
        "peak_flops": speed,
        "walks": walked,
        "share_of_peak": operations * walked[-1]["cuda_steps_per_s"] / speed,
        "errors": errors(options.sized(TOLERANCES, QUICK_TOLERANCES), sizes[0]),
        "labels": labels(sizes, options.sized(30, 1), rounds),
        "picture": draw(options, walked),
    }


def peak(count, attempts, rounds):
    """Operations of multiply-adds a second, two each."""

    def attempt(inputs, now):
        numbers, turns = now
        turn = lambda _, chains: tuple(x * inputs[0] + inputs[1] for x in chains)  # noqa: E731
        numbers = jax.lax.fori_loop(0, TURNS, turn, numbers)
        return (numbers, turns + 1.0), turns + 1.0 >= inputs[2]

    program = Program(
        start=lambda inputs: (tuple([inputs[0] + k for k in range(CHAINS)]), jnp.zeros(())),
        attempt=attempt,
        finish=lambda inputs, now: sum(now[0]),
    )
    inputs = tuple(np.full(count, value) for value in (0.999, 1e-3, float(attempts)))
    seconds = seconds_of({0: partial(CUDA.run, Request(program, inputs, batch=True))}, rounds)[0]
    return 2.0 * count * attempts * CHAINS * TURNS / seconds


def walks(sizes, duration, rounds):
    """Attempted steps a second by each engine."""
    engines = ["cuda", "lanes", *(["xla"] if jax.default_backend() == "gpu" else [])]
    rows = []
    for size in sizes:
        starts, row = perturbed(size), {"size": size}
        for engine in engines if size <= MOST_BY_LANES else engines[:1]:
            run = partial(walker(2e-6, engine=engine, duration=duration), starts)
            steps = float(np.sum(run()[1]))
            row[f"{engine}_steps_per_s"] = steps / seconds_of({0: run}, rounds)[0]
        rows.append(row)
    return rows


def errors(tolerances, size):
    """Median error of final states against a tight solve, and how many are the lanes' bits."""
    starts, rows, short = perturbed(size), [], dict(duration=QUICK_DURATION)
    truth = walker(1e-9, engine="lanes", **short)(starts)[0]
    for rtol in tolerances:
        found, ours = (walker(rtol, engine=e, **short)(starts)[0] for e in ("cuda", "lanes"))
        error = float(np.median(errors_of(found, truth)))
        same = float(np.mean(np.all(found == ours, axis=1)))
        rows.append({"rtol": rtol, "error": error, "same_bits": same})
    return rows


def labels(sizes, footsteps, rounds):
    """Labelled starts of the seed's slice a second, and how many labels are the lanes'."""
    cuda, lanes = (
        jb.labelling(jb.seed_scene(), footsteps=footsteps, engine=engine)
        for engine in ("cuda", "lanes")
    )
    ranges, rows = {"omega_swing": OMEGA, "theta_swing": THETA}, []
    for size in sizes:
        states = jb.starts.sample(cuda.scene, ranges, size).batch(cuda, 0, size).states
        row = {"size": size}
        for name, label_ in {"cuda": cuda, "lanes": lanes}.items():
            if name == "cuda" or size <= MOST_BY_LANES:
                seconds = seconds_of({0: partial(label_, states)}, rounds)[0]
                row[f"{name}_starts_per_s"] = size / seconds
        if size <= MOST_BY_LANES:
            row["labels_that_differ"] = int(np.sum(cuda(states).label != lanes(states).label))
        rows.append(row)
    return rows


def draw(options, walked):
    """Steps per second against the size of the batch."""
    ax = new_figure(6.0, 4.0).subplots()
    for engine in ("cuda", "lanes", "xla"):
        points = [(row["size"], row.get(f"{engine}_steps_per_s")) for row in walked]
        if points := [point for point in points if point[1]]:
            ax.plot(*zip(*points, strict=True), "o-", label=engine)
    label(ax, "starts in the batch", "attempted steps (1/s)", log="xy")
    ax.legend()
    return options.save(ax.figure, "gpu_speed.png")


if __name__ == "__main__":
    main()
