"""Long walks: whether a hundred thousand footsteps stay on the gait, in flat memory, and repeat.

Writes long_walks.png: durations of the footsteps of the seed's walker beside its gait's period.
"""

import resource
import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb

FOOTSTEPS, QUICK_FOOTSTEPS = 100_000, 2_000
SETTLED = 100
"""Footsteps after which the walk is on its gait."""
STEPS_EACH = 2_000
"""Solver steps that a footstep may take; about 320 are enough."""


def main() -> None:
    options = parse(__doc__ or "")
    count = QUICK_FOOTSTEPS if options.quick else FOOTSTEPS
    gait = jb.find_gait(jb.seed_scene(), parameters=(), radius_sensitivities=False)
    walked = [_walked(each) for each in tqdm((count // 10, count, count), desc="walks")]
    numbers = _numbers(float(gait.measures.period), walked)
    _print(options, numbers)
    options.finish(numbers | {"picture": _draw(options, numbers, walked[-1]["durations"])})


def _walked(count: int) -> dict[str, Any]:
    """A walk of so many footsteps: their durations, its time and the process's peak memory."""
    began = time.perf_counter()
    walk = jb.simulate(
        jb.seed_scene(),
        jb.seed_state(),
        footsteps=count,
        duration=float(count),
        save=jb.HeelStrike(),
        max_arrivals=count,
        max_solver_steps=STEPS_EACH * count,
    )
    assert walk.arrivals is not None
    times = np.asarray(walk.arrivals.t)
    return {
        "outcome": str(walk.outcome),
        "durations": np.diff(times[np.isfinite(times)]),
        "seconds": time.perf_counter() - began,
        "peak_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


def _numbers(period: float, walked: list[dict[str, Any]]) -> dict[str, Any]:
    short, long, again = walked
    durations = long["durations"]
    windows = np.array_split(durations[SETTLED:], 10)
    return {
        "footsteps": len(durations) + 1,
        "outcome": long["outcome"],
        "period_s": period,
        "mean_s": float(durations[SETTLED:].mean()),
        "window_std_s": [float(each.std()) for each in windows],
        "window_mean_s": [float(each.mean()) for each in windows],
        "largest_deviation_s": float(np.max(np.abs(durations[SETTLED:] - period))),
        "repeats": bool(np.array_equal(durations, again["durations"])),
        "peak_MiB": [each["peak_MiB"] for each in (short, long)],
        "seconds": long["seconds"],
    }


def _print(options: Options, numbers: dict[str, Any]) -> None:
    period = numbers["period_s"]
    options.say(f"{numbers['footsteps']} footsteps, {numbers['outcome']}")
    options.say(f"mean duration differs from the period by {numbers['mean_s'] / period - 1.0:+.1e}")
    options.say(f"largest deviation {numbers['largest_deviation_s'] / period:.1e} of the period")
    spread = [each / period for each in numbers["window_std_s"]]
    options.say(f"scatter in tenths of the walk: {spread[0]:.1e} first, {spread[-1]:.1e} last")
    low, high = numbers["peak_MiB"]
    options.say(f"peak memory {low:.0f} MiB after a tenth, {high:.0f} MiB after all")
    options.say(f"the same again: {'identical' if numbers['repeats'] else 'DIFFERENT'}")


def _draw(options: Options, numbers: dict[str, Any], durations: np.ndarray) -> str:
    figure, ax = plt.subplots(figsize=(7.0, 3.8), layout="constrained")
    off = np.abs(durations / numbers["period_s"] - 1.0)
    ax.semilogy(np.arange(1, len(off) + 1), np.maximum(off, 1e-16), ",", rasterized=True)
    ax.set_ylim(1e-12, 10.0 * float(np.max(off)))
    ax.set_xlabel("footstep [1]")
    ax.set_ylabel("duration's difference from the period [relative]")
    return options.save(figure, "long_walks.png")


if __name__ == "__main__":
    main()
