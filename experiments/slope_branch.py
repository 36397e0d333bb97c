"""The seed's gait along the slope, from its lower to its upper loss of stability.

Compliant, with bristles and rigid. Each loss of stability is located on the branch and held against
bisection by `find_gait`: at the fold on whether a gait is found, at the period doubling on its
multiplier. Also the time of a hundred gaits with their multipliers. Writes slope_branch.png.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from _options import Options, parse

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

BOUNDS = (0.005, 0.11)
SCENES = ("stribeck", "bristles", "rigid")
HALVINGS, QUICK_HALVINGS = 26, 12
FIRST_GAP = 2e-4
"""Width of the bracket that bisection begins with [rad]."""
TIMED = 100
"""Gaits whose time is measured."""


def main() -> None:
    options = parse(__doc__ or "")
    accuracy = "balanced" if options.quick else "tight"
    halvings = QUICK_HALVINGS if options.quick else HALVINGS
    names = ("stribeck", "rigid") if options.quick else SCENES
    branches, found = {}, {}
    for name in names:
        scene = jb.ladder()[name]
        branches[name] = jb.continue_gait(scene, "slope", bounds=BOUNDS, accuracy=accuracy)
        found[name] = numbers_of(options, name, branches[name], halvings)
    timings = timing(options, jb.ladder()["stribeck"])
    picture = draw(options, branches)
    options.finish({"scenes": found, "hundred_gaits": timings, "picture": picture})


def numbers_of(options: Options, name: str, branch: Any, halvings: int) -> dict[str, Any]:
    """The losses of stability of the stable part, each with what bisection finds."""
    rows = []
    for event in losses(branch):
        bisected = bisect(branch, event, halvings)
        rows.append(
            {
                "kind": str(event.kind),
                "slope": event.value,
                "multiplier": [event.multiplier.real, event.multiplier.imag],
                "error": event.error,
                "bisection": bisected,
                "off": abs(bisected[1] - event.value),
            }
        )
        options.say(
            f"{name:<9} {event.kind} at {event.value:.9f}, multiplier {event.multiplier.real:.9f} "
            f"± {event.error:.0e}; by bisection between {bisected[0]:.9f} and {bisected[1]:.9f}"
        )
    ends = [
        {"end": str(stop.end), "cause": stop.cause, "slope": stop.value} for stop in branch.stops
    ]
    for end in ends:
        options.say(f"{name:<9} ends at {end['slope']:.9f}: {end['end']} ({end['cause']})")
    return {"gaits": len(branch), "losses": rows, "ends": ends}


def losses(branch: Any) -> list[Any]:
    """The bifurcations with a stable gait on one side of them."""
    stable = branch.values[[each is True for each in branch.stable]]
    width = np.max(np.abs(np.diff(np.sort(stable))))
    return [
        event
        for event in branch.bifurcations
        if event.kind in ("fold", "period-doubling")
        and np.min(np.abs(stable - event.value)) <= width
        and abs(abs(event.point.multipliers[0]) - 1.0) < 1e-3
    ]


def bisect(branch: Any, event: Any, halvings: int) -> list[float]:
    """Slopes between which `find_gait` says that stability is lost, the stable one first."""
    sign = 1.0 if event.kind == "period-doubling" else -1.0
    start = event.value - sign * 0.5 * FIRST_GAP
    at = int(np.argmin([abs(p.value - start) if p.stable else np.inf for p in branch.points]))
    guess = find(branch, start, branch.state(at)).measures.state
    within, beyond = start, event.value + sign * 0.5 * FIRST_GAP
    for _ in range(halvings):
        middle = 0.5 * (within + beyond)
        gait = find(branch, middle, guess)
        if bool(gait.stable):
            within, guess = middle, gait.measures.state
        else:
            beyond = middle
    return [within, beyond]


def find(branch: Any, slope: float, guess: Any) -> Any:
    scene = jb.with_parameters(branch.scene, {"slope": slope})
    return jb.find_gait(
        scene, guess, parameters=(), radius_sensitivities=False, accuracy=branch.accuracy
    )


def timing(options: Options, scene: Any) -> dict[str, float]:
    """Seconds, of the clock and of the processor, for a hundred gaits of the stable branch."""

    def hundred() -> Any:
        return jb.continue_gait(
            scene, "slope", bounds=(0.0096, 0.099), largest_step=0.0125, max_points=TIMED
        )

    jb.clear_caches()
    cold, warm = timed(hundred), timed(hundred)
    gaits = len(warm[0])
    row = {
        "gaits": gaits,
        "cold_wall_s": cold[1],
        "cold_cpu_s": cold[2],
        "warm_wall_s": warm[1],
        "warm_cpu_s": warm[2],
    }
    options.say(
        f"{gaits} gaits with multipliers: {warm[1]:.1f} s warm ({warm[2]:.1f} s of processor), "
        f"{cold[1]:.1f} s with compilation ({cold[2]:.1f} s)"
    )
    return row


def timed(run: Callable[[], Any]) -> tuple[Any, float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    found = run()
    return found, time.perf_counter() - wall, time.process_time() - cpu


def draw(options: Options, branches: dict[str, Any]) -> str:
    titles = {"stribeck": "compliant", "bristles": "compliant, bristles", "rigid": "rigid"}
    figure = new_figure(5.4 * len(branches), 8.4)
    grid = figure.subplots(2, len(branches), squeeze=False, sharex=True)
    for column, (name, branch) in enumerate(branches.items()):
        plot.branch(branch, "step_length", ax=grid[0, column])
        plot.branch(branch, "spectral_radius", ax=grid[1, column])
        grid[0, column].set_title(f"The seed's walker, {titles[name]}", loc="left")
        grid[0, column].get_legend().remove()
        grid[1, column].set_ylim(0.0, 3.0)
        grid[1, column].set_title("")
    return options.save(figure, "slope_branch.png")


if __name__ == "__main__":
    main()
