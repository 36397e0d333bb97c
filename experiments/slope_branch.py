"""The seed's gait along the slope, from its lower to its upper loss of stability.

Compliant, with bristles and rigid. Each loss of stability is located on the branch and held against
bisection by `find_gait`: at the fold on whether a gait is found, at the period doubling on its
multiplier. Also the time of a hundred gaits with their multipliers. Writes slope_branch.png.
"""

import numpy as np
from _experiment import Options, experiment
from _timing import timed

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

BOUNDS = (0.005, 0.11)
SCENES = {"stribeck": "compliant", "bristles": "compliant, bristles", "rigid": "rigid"}
HALVINGS, QUICK_HALVINGS = 26, 12
FIRST_GAP = 2e-4
"""Width of the bracket that bisection begins with [rad]."""
TIMED = 100
"""Gaits whose time is measured."""


@experiment
def main(options: Options):
    accuracy, halvings = options.sized("tight", "balanced"), options.sized(HALVINGS, QUICK_HALVINGS)
    branches = {
        name: jb.continue_gait(jb.ladder()[name], "slope", bounds=BOUNDS, accuracy=accuracy)
        for name in options.sized(SCENES, ("stribeck", "rigid"))
    }
    return {
        "scenes": {name: numbers_of(branch, halvings) for name, branch in branches.items()},
        "hundred_gaits": timing(jb.ladder()["stribeck"]),
        "picture": draw(options, branches),
    }


def numbers_of(branch, halvings):
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
    ends = [dict(end=str(each.end), cause=each.cause, slope=each.value) for each in branch.stops]
    return {"gaits": len(branch), "losses": rows, "ends": ends}


def losses(branch):
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


def bisect(branch, event, halvings):
    """Slopes between which `find_gait` says that stability is lost, the stable one first."""
    sign = 1.0 if event.kind == "period-doubling" else -1.0
    within, beyond = (event.value + sign * side * 0.5 * FIRST_GAP for side in (-1.0, 1.0))
    at = int(np.argmin([abs(p.value - within) if p.stable else np.inf for p in branch.points]))

    def find(slope, guess):
        scene = jb.with_parameters(branch.scene, {"slope": slope})
        how = dict(parameters=(), radius_sensitivities=False, accuracy=branch.accuracy)
        return jb.find_gait(scene, guess, **how)

    guess = find(within, branch.state(at)).measures.state
    for _ in range(halvings):
        middle = 0.5 * (within + beyond)
        gait = find(middle, guess)
        if bool(gait.stable):
            within, guess = middle, gait.measures.state
        else:
            beyond = middle
    return [within, beyond]


def timing(scene):
    """Seconds, of the clock and of the processor, for a hundred gaits of the stable branch."""
    how = dict(bounds=(0.0096, 0.099), largest_step=0.0125, max_points=TIMED)

    def hundred():
        return jb.continue_gait(scene, "slope", **how)

    jb.clear_caches()
    _, cold_wall, cold_cpu = timed(hundred)
    found, wall, cpu = timed(hundred)
    cold = {"cold_wall_s": cold_wall, "cold_cpu_s": cold_cpu}
    return {"gaits": len(found), **cold, "warm_wall_s": wall, "warm_cpu_s": cpu}


def draw(options, branches):
    figure = new_figure(5.4 * len(branches), 8.4)
    grid = figure.subplots(2, len(branches), squeeze=False, sharex=True)
    for (upper, lower), (name, branch) in zip(grid.T, branches.items(), strict=True):
        plot.branch(branch, "step_length", ax=upper)
        plot.branch(branch, "spectral_radius", ax=lower)
        upper.set_title(f"The seed's walker, {SCENES[name]}", loc="left")
        upper.get_legend().remove()
        lower.set_ylim(0.0, 3.0)
        lower.set_title("")
    return options.save(figure, "slope_branch.png")


if __name__ == "__main__":
    main()
