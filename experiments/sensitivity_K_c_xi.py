"""How a gait depends on contact stiffness K, damping c and the Stribeck rate xi.

Writes sensitivity_K_c_xi.png. Each parameter goes over two decades about the seed's value; every
point is a periodic gait of its own, with elasticities d log(measure) / d log(parameter): 0.01 means
that one per cent more of the parameter makes the measure 0.01 per cent larger.
"""

import numpy as np
from _experiment import Options, experiment

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

SEED = {"K": 1e6, "c": 1e7, "xi": 1e3}
UNITS = {"K": "N/m$^{1.5}$", "c": "N s/m$^2$", "xi": "s/m"}
MEASURES = {
    "period": "period",
    "step_length": "step length",
    "speed": "speed",
    "peak_normal": "peak force",
    "spectral_radius": "spectral radius",
}
POINTS, QUICK_POINTS = 17, 3
DECADES = 1.0
"""To each side of the seed's value."""


@experiment
def main(options: Options):
    count, radius = options.sized(POINTS, QUICK_POINTS), not options.quick
    keys = [key for key in MEASURES if radius or key != "spectral_radius"]
    found = {name: swept(name, count, radius) for name in SEED}
    draw(options, found, keys)
    return {
        "parameters": list(SEED),
        "units": UNITS,
        "points": found,
        "without_a_gait": [
            {"parameter": name, "value": point["value"], "outcome": point["outcome"]}
            for name, points in found.items()
            for point in points
            if point["outcome"] != str(jb.gait.Search.FOUND)
        ],
    }


def swept(name, count, radius):
    """Gaits from the seed's value outwards, each searched from its neighbour's state."""
    values = SEED[name] * np.logspace(-DECADES, DECADES, count)
    how = dict(parameters=tuple(SEED), radius_sensitivities=radius)
    gaits = jb.gait_sweep(jb.seed_scene(), {name: values}, **how)
    return [point(name, float(values[i]), gaits.isel({name: i})) for i in range(count)]


def point(name, value, gait):
    """A gait with one parameter at a value; NaN in all its numbers where none was found.

    Elasticities and their estimated errors are of each measure with respect to K, c and xi.
    """
    parameters = np.asarray(list((SEED | {name: value}).values()))

    def error(key):
        return gait[f"sensitivity_{key}_error"].data * parameters / abs(float(gait[key]))

    return {
        "value": value,
        "outcome": str(jb.gait.Search(int(gait.ending))),
        "stable": float(gait.spectral_radius) < 1.0,
        "residual": float(gait.residual),
        "measures": {key: float(gait[key]) for key in MEASURES},
        "elasticities": {key: gait[f"elasticity_{key}"].data.tolist() for key in MEASURES},
        "errors": {key: error(key).tolist() for key in MEASURES},
    }


def own(name, points, key, kind="elasticities"):
    """Elasticities of a measure, or their errors, in the very parameter that is swept."""
    place = list(SEED).index(name)
    return np.asarray([point[kind][key][place] for point in points])


def draw(options, found, keys):
    """A row for each measure, a column for each parameter."""
    figure = new_figure(10.5, 1.0 + 1.9 * len(keys))
    grid = figure.subplots(len(keys), 3, sharex="col")
    for column, (name, points) in zip(grid.T, found.items(), strict=True):
        for axes, key in zip(column, keys, strict=True):
            panel(axes, name, points, key)
        column[0].set_title(f"with respect to {name}", fontsize=10)
        column[-1].set_xlabel(f"{name} [{UNITS[name]}]")
    for axes, key in zip(grid[:, 0], keys, strict=True):
        axes.set_ylabel(f"elasticity of\n{MEASURES[key]}")
    title = "d log(measure) / d log(parameter) of periodic gaits\n"
    figure.suptitle(f"{title}bars: estimated errors; dotted: the seed's value", fontsize=11)
    return options.save(figure, "sensitivity_K_c_xi.png")


def panel(axes, name, points, key):
    values, errors = [point["value"] for point in points], own(name, points, key, "errors")
    # The radius's elasticity jumps where another multiplier becomes the largest: no line there.
    form = "o" if key == "spectral_radius" else "o-"
    axes.errorbar(values, own(name, points, key), errors, fmt=form, ms=3.5, capsize=2.0)
    axes.set_xscale("log")
    axes.axvline(SEED[name], color="#595959", linewidth=0.8, linestyle=":")
    axes.axhline(0.0, color="#595959", linewidth=0.8)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    axes.grid(alpha=0.3)


if __name__ == "__main__":
    main()
