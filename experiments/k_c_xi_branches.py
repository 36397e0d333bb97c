"""The seed's gait along stiffness K, damping c and Stribeck rate ξ, and where it loses stability.

Branches over decades, with what they end by; the fold and the period doubling along the slope,
followed in the planes (slope, K) and (slope, c). Writes k_c_xi_branches.png and
k_c_xi_curves.png.
"""

from _experiment import Options, experiment

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

RANGES = {"K": (1e4, 1e8), "c": (1e4, 1e9), "xi": (10.0, 1e5)}
QUICK_RANGES = {"K": (5e5, 2e6)}
PLANES = {"K": (1e5, 1e7), "c": (1e6, 1e8)}
QUICK_PLANES = {"K": (8e5, 1.25e6)}
SLOPES = (0.003, 0.11)


@experiment
def main(options: Options):
    scene = jb.seed_scene()
    branches = {
        name: jb.continue_gait(scene, name, bounds=bounds)
        for name, bounds in options.sized(RANGES, QUICK_RANGES).items()
    }
    slope = jb.continue_gait(scene, "slope", bounds=SLOPES, max_points=120)
    count = options.sized(40, 2)
    curves = {
        name: [curve_of(slope, kind, name, bounds, count) for kind in ("fold", "period-doubling")]
        for name, bounds in options.sized(PLANES, QUICK_PLANES).items()
    }
    return {
        "branches": {name: numbers_of(branch) for name, branch in branches.items()},
        "curves": {name: [points_of(each) for each in row] for name, row in curves.items()},
        "pictures": [draw_branches(options, branches), draw_curves(options, curves)],
    }


def numbers_of(branch):
    return {
        "gaits": len(branch),
        "bifurcations": [
            {
                "kind": str(each.kind),
                "value": each.value,
                "multiplier": [each.multiplier.real, each.multiplier.imag],
                "error": each.error,
            }
            for each in branch.bifurcations
        ],
        "ends": ends_of(branch),
        "stable": [point.stable for point in branch.points],
        "value": branch.values.tolist(),
    }


def ends_of(branch):
    return [[str(stop.end), stop.cause, stop.value] for stop in branch.stops]


def curve_of(slope, kind, name, bounds, count):
    """The stable gaits' fold or period doubling in the plane of the slope and a parameter."""
    events = (each for each in slope.bifurcations if each.kind == kind)
    event = min(events, key=lambda each: abs(abs(each.point.multipliers[0]) - 1.0))
    how = dict(bounds=bounds, max_points=count)
    return jb.continuation.bifurcation_curve(slope, event, name, **how)


def points_of(curve):
    return {
        "kind": str(curve.kind),
        "along": list(curve.along),
        "values": curve.values.tolist(),
        "off": [abs(abs(value) - 1.0) for value in curve.multipliers.tolist()],
        "errors": curve.errors.tolist(),
        "ends": ends_of(curve),
    }


def draw_branches(options, branches):
    figure = new_figure(5.4 * len(branches), 8.4)
    grid = figure.subplots(2, len(branches), squeeze=False)
    for (upper, lower), branch in zip(grid.T, branches.values(), strict=True):
        plot.branch(branch, "step_length", ax=upper)
        plot.branch(branch, "spectral_radius", ax=lower)
        lower.set_ylim(0.0, 2.0)
        lower.set_title("")
        upper.get_legend().remove()
    return options.save(figure, "k_c_xi_branches.png")


def draw_curves(options, curves):
    figure = new_figure(5.8 * len(curves), 4.8)
    axes = figure.subplots(1, len(curves), squeeze=False)[0]
    for ax, row in zip(axes, curves.values(), strict=True):
        plot.bifurcation_curves(row, ax=ax)
    return options.save(figure, "k_c_xi_curves.png")


if __name__ == "__main__":
    main()
