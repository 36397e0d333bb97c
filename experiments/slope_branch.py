"""The seed's gait along the slope between its losses of stability, and how these move.

Compliant, with bristles and rigid. Each loss of stability is located on the branch and held against
bisection by `find_gait`: at the fold on whether a gait is found, at the period doubling on its
multiplier. Its derivatives with respect to every parameter are beside differences of bifurcations
that were located again for changed parameters. Then branches along K, c and ξ, what they end by,
and the losses followed in the planes (slope, K) and (slope, c). Also the time of a hundred gaits.

Writes slope_branch.png, bifurcation_elasticities.png, k_c_xi_branches.png and k_c_xi_curves.png.
"""

import numpy as np
from _experiment import Options, experiment
from _timing import timed

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

BOUNDS = (0.003, 0.11)
SCENES = {"stribeck": "compliant", "bristles": "compliant, bristles", "rigid": "rigid"}
HALVINGS, QUICK_HALVINGS = 26, 12
FIRST_GAP = 2e-4
"""Width of the bracket that bisection begins with [rad]."""
TIMED = 100
"""Gaits whose time is measured."""
CHANGE, NEAR = 1e-3, 0.06
"""Relative changes of a parameter for the differences, and of the slope within which a moved
bifurcation is sought."""
CHECKED = ("r", "K")
"""Parameters whose elasticity is checked by differences, where a scene has them."""
RANGES = {"K": (1e4, 1e8), "c": (1e4, 1e9), "xi": (10.0, 1e5)}
QUICK_RANGES = {"K": (5e5, 2e6)}
PLANES = {"K": (1e5, 1e7), "c": (1e6, 1e8)}
QUICK_PLANES = {"K": (8e5, 1.25e6)}


@experiment
def main(options: Options):
    # A rigid walker's branch takes no time.
    accuracies = dict.fromkeys(SCENES, "tight") | options.sized({}, {"stribeck": "balanced"})
    slopes = {
        name: along_slope(jb.ladder()[name], BOUNDS, accuracies[name])
        for name in options.sized(SCENES, ("stribeck", "rigid"))
    }
    scene, halvings = jb.seed_scene(), options.sized(HALVINGS, QUICK_HALVINGS)
    cases = {
        f"{event.kind}, {SCENES[name]}".removeprefix("period-"): elasticities(slopes[name], event)
        for name in options.sized(("stribeck", "rigid"), ("rigid",))
        for event in losses(slopes[name])
    }
    branches = {
        name: jb.continue_gait(scene, name, bounds=bounds)
        for name, bounds in options.sized(RANGES, QUICK_RANGES).items()
    }
    how = dict(max_points=options.sized(40, 2))
    curves = {
        name: [
            jb.continuation.bifurcation_curve(slopes["stribeck"], event, name, bounds=bounds, **how)
            for event in losses(slopes["stribeck"])
        ]
        for name, bounds in options.sized(PLANES, QUICK_PLANES).items()
    }
    return {
        "scenes": {name: of_slope(branch, halvings) for name, branch in slopes.items()},
        "hundred_gaits": timing(scene),
        "cases": cases,
        "branches": {name: of_branch(branch) for name, branch in branches.items()},
        "curves": {name: [of_curve(each) for each in row] for name, row in curves.items()},
        "pictures": [
            draw_branches(options, "slope_branch.png", slopes),
            draw_elasticities(options, cases),
            draw_branches(options, "k_c_xi_branches.png", branches),
            draw_curves(options, curves),
        ],
    }


def along_slope(scene, bounds, accuracy, **how):
    return jb.continue_gait(scene, "slope", bounds=bounds, accuracy=accuracy, **how)


def of_slope(branch, halvings):
    """The losses of stability of the stable part, each with what bisection finds."""
    rows = []
    for event in losses(branch):
        bisected = bisect(branch, event, halvings)
        off = abs(bisected[1] - event.value)
        rows.append(of_event(event, "slope") | {"bisection": bisected, "off": off})
    ends = [dict(end=end, cause=cause, slope=slope) for end, cause, slope in ends_of(branch)]
    return {"gaits": len(branch), "losses": rows, "ends": ends}


def of_event(event, parameter):
    """A bifurcation at a value of a parameter."""
    return {
        "kind": str(event.kind),
        parameter: event.value,
        "multiplier": [event.multiplier.real, event.multiplier.imag],
        "error": event.error,
    }


def ends_of(branch):
    return [[str(stop.end), stop.cause, stop.value] for stop in branch.stops]


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


def elasticities(branch, event):
    """How a critical slope moves with every parameter, some also by differences."""
    known = jb.continuation.bifurcation_sensitivities(branch, event)
    values = {name: float(value) for name, value in jb.parameter_values(branch.scene).items()}
    columns = known.parameters, known.slopes, known.errors, known.elasticities
    rows = {
        name: {"slope": float(slope), "error": float(error), "elasticity": float(elasticity)}
        for name, slope, error, elasticity in zip(*columns, strict=True)
        if values[name] != 0.0
    }
    side = 0.5 * NEAR if event.kind == "fold" else -0.5 * NEAR
    start = {"slope": event.value * (1.0 + side)}
    bounds = tuple(event.value * (1.0 + change) for change in (-NEAR, NEAR))

    def located(name, change):
        scene = jb.with_parameters(branch.scene, start | {name: values[name] * (1.0 + change)})
        found = along_slope(scene, bounds, "tight", max_points=40).bifurcations
        return next(each.value for each in found if each.kind == event.kind)

    for name in (each for each in CHECKED if each in rows):
        apart = located(name, CHANGE) - located(name, -CHANGE)
        rows[name]["by_differences"] = apart / (2.0 * CHANGE) / known.value
    return {"slope_rad": known.value, "parameters": rows}


def timing(scene):
    """Seconds, of the clock and of the processor, for a hundred gaits of the stable branch."""

    def hundred():
        how = dict(largest_step=0.0125, max_points=TIMED)
        return along_slope(scene, (0.0096, 0.099), "balanced", **how)

    jb.clear_caches()
    _, cold_wall, cold_cpu = timed(hundred)
    found, wall, cpu = timed(hundred)
    cold = {"cold_wall_s": cold_wall, "cold_cpu_s": cold_cpu}
    return {"gaits": len(found), **cold, "warm_wall_s": wall, "warm_cpu_s": cpu}


def of_branch(branch):
    return {
        "gaits": len(branch),
        "bifurcations": [of_event(each, "value") for each in branch.bifurcations],
        "ends": ends_of(branch),
        "stable": [point.stable for point in branch.points],
        "value": branch.values.tolist(),
    }


def of_curve(curve):
    return {
        "kind": str(curve.kind),
        "along": list(curve.along),
        "values": curve.values.tolist(),
        "off": [abs(abs(value) - 1.0) for value in curve.multipliers.tolist()],
        "errors": curve.errors.tolist(),
        "ends": ends_of(curve),
    }


def draw_branches(options, name, branches):
    figure = new_figure(5.4 * len(branches), 8.4)
    grid = figure.subplots(2, len(branches), squeeze=False)
    for (upper, lower), (kind, branch) in zip(grid.T, branches.items(), strict=True):
        plot.branch(branch, "step_length", ax=upper)
        plot.branch(branch, "spectral_radius", ax=lower)
        if kind in SCENES:
            upper.set_title(f"The seed's walker, {SCENES[kind]}", loc="left")
        upper.get_legend().remove()
        lower.set_ylim(0.0, 3.0 if kind in SCENES else 2.0)
        lower.set_title("", loc="left")
    return options.save(figure, name)


def draw_curves(options, curves):
    figure = new_figure(5.8 * len(curves), 4.8)
    axes = figure.subplots(1, len(curves), squeeze=False)[0]
    for ax, row in zip(axes, curves.values(), strict=True):
        plot.bifurcation_curves(row, ax=ax)
    return options.save(figure, "k_c_xi_curves.png")


def draw_elasticities(options, found):
    names = list(dict.fromkeys(name for case in found.values() for name in case["parameters"]))
    ax, width = new_figure(8.0, 4.2).subplots(), 0.8 / len(found)
    for k, (case, each) in enumerate(found.items()):
        rows = each["parameters"]
        places = np.array([i for i, name in enumerate(names) if name in rows])
        heights = [rows[names[i]]["elasticity"] for i in places]
        label = f"{case}: {each['slope_rad']:.4f} rad"
        ax.bar(places + (k + 0.5) * width - 0.4, heights, width, label=label)
    quantities = jb.parameter_quantities(jb.seed_scene())
    ax.set_xticks(range(len(names)), [quantities[name].symbol for name in names])
    ax.set_yscale("symlog", linthresh=1e-3)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set(xlabel="parameter", ylabel="elasticity of the critical slope (–)")
    ax.legend()
    return options.save(ax.figure, "bifurcation_elasticities.png")


if __name__ == "__main__":
    main()
