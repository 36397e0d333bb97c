"""How the slopes at which the seed's gait loses its stability move with the walker and its contact.

Writes bifurcation_elasticities.png: relative change of each critical slope over relative change of
each parameter, from derivatives at the bifurcation itself, beside differences of bifurcations that
were located again for changed parameters.
"""

import numpy as np
from _experiment import Options, experiment
from _scenes import rigid_seed
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent
from jaxbiped.plot.style import new_figure

CHANGE = 1e-3
"""Relative change of a parameter for the differences."""
CHECKED = ("r", "K")
"""Parameters whose elasticity is checked by differences, where a scene has them."""
FOLD, DOUBLING = BranchEvent.FOLD, BranchEvent.PERIOD_DOUBLING
CASES = {
    "fold, compliant": (jb.seed_scene(slope=0.0105), FOLD, (0.009, 0.0108)),
    "doubling, compliant": (jb.seed_scene(slope=0.097), DOUBLING, (0.095, 0.101)),
    "doubling, rigid": (rigid_seed(0.098), DOUBLING, (0.095, 0.105)),
}
"""By name: a scene near the bifurcation, its kind, and slopes about it [rad]."""


@experiment
def main(options: Options):
    names = options.sized(list(CASES), ["doubling, rigid"])
    found = {name: studied(*CASES[name]) for name in tqdm(names, desc="bifurcations")}
    return {"cases": found, "picture": draw(options, found)}


def located(scene, kind, bounds):
    branch = jb.continue_gait(scene, bounds=bounds, accuracy="tight", max_points=40)
    return branch, next(each for each in branch.bifurcations if each.kind is kind)


def studied(scene, kind, bounds):
    branch, bifurcation = located(scene, kind, bounds)
    known = jb.continuation.bifurcation_sensitivities(branch, bifurcation)
    values = {name: float(value) for name, value in jb.parameter_values(scene).items()}
    columns = known.parameters, known.slopes, known.errors, known.elasticities
    rows = {
        name: {"slope": float(slope), "error": float(error), "elasticity": float(elasticity)}
        for name, slope, error, elasticity in zip(*columns, strict=True)
        if values[name] != 0.0
    }
    for name in (each for each in CHECKED if each in rows):
        up, down = (
            jb.with_parameters(scene, {name: values[name] * (1.0 + change)})
            for change in (CHANGE, -CHANGE)
        )
        apart = located(up, kind, bounds)[1].value - located(down, kind, bounds)[1].value
        rows[name]["by_differences"] = apart / (2.0 * CHANGE) / known.value
    return {"slope_rad": known.value, "parameters": rows}


def draw(options, found):
    names = list(dict.fromkeys(name for case in found.values() for name in case["parameters"]))
    figure = new_figure(8.0, 4.2)
    ax = figure.subplots()
    width = 0.8 / len(found)
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
    ax.set(xlabel="parameter", ylabel="elasticity of the critical slope [1]")
    ax.legend()
    return options.save(figure, "bifurcation_elasticities.png")


if __name__ == "__main__":
    main()
