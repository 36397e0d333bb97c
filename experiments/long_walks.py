"""Long walks: whether a hundred thousand footsteps stay on the gait, in flat memory, and repeat.

Writes long_walks.png: durations of the footsteps of the seed's walker beside its gait's period.
"""

import resource

import numpy as np
from _experiment import Options, experiment, label
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

FOOTSTEPS, QUICK_FOOTSTEPS = 100_000, 2_000
SETTLED = 100
"""Footsteps after which the walk is on its gait."""
STEPS_EACH = 2_000
"""Solver steps that a footstep may take; about 320 are enough."""


@experiment
def main(options: Options):
    count = options.sized(FOOTSTEPS, QUICK_FOOTSTEPS)
    gait = jb.find_gait(jb.seed_scene(), parameters=(), radius_sensitivities=False)
    period = float(gait.measures.period)
    short, long, again = (walked(each) for each in tqdm((count // 10, count, count), desc="walks"))
    durations = long["durations"]
    on_gait = durations[SETTLED:]
    windows = np.array_split(on_gait, 10)
    return {
        "footsteps": len(durations) + 1,
        "outcome": long["outcome"],
        "period_s": period,
        "mean_s": float(on_gait.mean()),
        "window_std_s": [float(each.std()) for each in windows],
        "window_mean_s": [float(each.mean()) for each in windows],
        "largest_deviation_s": float(np.max(np.abs(on_gait - period))),
        "repeats": bool(np.array_equal(durations, again["durations"])),
        "peak_MiB": [short["peak_MiB"], long["peak_MiB"]],
        "picture": draw(options, period, again["durations"]),
    }


def walked(count):
    """A walk of so many footsteps: their durations, and the process's peak memory."""
    walk = jb.simulate(
        jb.seed_scene(),
        jb.seed_state(),
        footsteps=count,
        duration=float(count),
        save=jb.HeelStrike(),
        max_arrivals=count,
        max_solver_steps=STEPS_EACH * count,
    )
    times = np.asarray(walk.arrivals.t)
    return {
        "outcome": str(walk.outcome),
        "durations": np.diff(times[np.isfinite(times)]),
        "peak_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


def draw(options, period, durations):
    ax = new_figure(7.0, 3.8).subplots()
    off = np.abs(durations / period - 1.0)
    ax.plot(np.arange(1, len(off) + 1), np.maximum(off, 1e-16), ",", rasterized=True)
    label(ax, "footstep", "duration's difference from the period (relative)", log="y")
    ax.set_ylim(1e-12, 10.0 * float(np.max(off)))
    return options.save(ax.figure, "long_walks.png")


if __name__ == "__main__":
    main()
