"""How the slopes at which the seed's gait loses its stability move with the walker and its contact.

Writes bifurcation_elasticities.png: relative change of each critical slope over relative change of
each parameter, from derivatives at the bifurcation itself, beside differences of bifurcations that
were located again for changed parameters.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent

CHANGE = 1e-3
"""Relative change of a parameter for the differences."""
CHECKED = ("r", "K")
"""Parameters whose elasticity is checked by differences, where a scene has them."""


def cases() -> dict[str, tuple[Any, BranchEvent, tuple[float, float]]]:
    """By name: a scene near the bifurcation, its kind, and slopes about it [rad]."""
    rigid = jb.with_parameters(jb.ladder()["rigid"], {"slope": 0.098})
    fold, doubling = BranchEvent.FOLD, BranchEvent.PERIOD_DOUBLING
    return {
        "fold, compliant": (jb.seed_scene(slope=0.0105), fold, (0.009, 0.0108)),
        "doubling, compliant": (jb.seed_scene(slope=0.097), doubling, (0.095, 0.101)),
        "doubling, rigid": (rigid, doubling, (0.095, 0.105)),
    }


def main() -> None:
    options = parse(__doc__ or "")
    chosen = cases()
    if options.quick:
        chosen = {"doubling, rigid": chosen["doubling, rigid"]}
    numbers = {}
    for name, case in tqdm(chosen.items(), desc="bifurcations"):
        numbers[name] = _studied(*case)
    _print(options, numbers)
    options.finish({"cases": numbers, "picture": _draw(options, numbers)})


def _located(scene: Any, kind: BranchEvent, bounds: tuple[float, float]) -> Any:
    branch = jb.continue_gait(scene, bounds=bounds, accuracy="tight", max_points=40)
    return branch, next(each for each in branch.bifurcations if each.kind is kind)


def _studied(scene: Any, kind: BranchEvent, bounds: tuple[float, float]) -> dict[str, Any]:
    branch, bifurcation = _located(scene, kind, bounds)
    known = jb.continuation.bifurcation_sensitivities(branch, bifurcation)
    values = jb.parameter_values(scene)
    rows = {
        name: {
            "slope": float(known.slopes[k]),
            "error": float(known.errors[k]),
            "elasticity": float(known.elasticities[k]),
        }
        for k, name in enumerate(known.parameters)
        if float(values[name]) != 0.0
    }
    for name in (each for each in CHECKED if each in rows):
        own = float(values[name])
        up, down = (
            _located(jb.with_parameters(scene, {name: own * (1.0 + change)}), kind, bounds)[1].value
            for change in (CHANGE, -CHANGE)
        )
        rows[name]["by_differences"] = (up - down) / (2.0 * CHANGE) / known.value
    return {"slope_rad": known.value, "parameters": rows}


def _print(options: Options, numbers: dict[str, Any]) -> None:
    for name, found in numbers.items():
        options.say(f"{name} at {found['slope_rad']:.9f} rad")
        for parameter, row in found["parameters"].items():
            checked = row.get("by_differences")
            beside = "" if checked is None else f"   by differences {checked:+.7f}"
            options.say(f"  {parameter:12s}{row['elasticity']:+.7f}{beside}")


def _draw(options: Options, numbers: dict[str, Any]) -> str:
    names = list(dict.fromkeys(each for found in numbers.values() for each in found["parameters"]))
    figure, ax = plt.subplots(figsize=(8.0, 4.2), layout="constrained")
    width = 0.8 / len(numbers)
    for k, (case, found) in enumerate(numbers.items()):
        rows = found["parameters"]
        places = [i for i, name in enumerate(names) if name in rows]
        heights = [rows[names[i]]["elasticity"] for i in places]
        label = f"{case}: {found['slope_rad']:.4f} rad"
        ax.bar(np.array(places) + (k + 0.5) * width - 0.4, heights, width, label=label)
    quantities = jb.parameter_quantities(cases()["fold, compliant"][0])
    ax.set_xticks(range(len(names)), [quantities[name].symbol for name in names])
    ax.set_yscale("symlog", linthresh=1e-3)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set_xlabel("parameter")
    ax.set_ylabel("elasticity of the critical slope [1]")
    ax.legend()
    return options.save(figure, "bifurcation_elasticities.png")


if __name__ == "__main__":
    main()
