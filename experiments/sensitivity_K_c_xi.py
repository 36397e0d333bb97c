"""How a gait depends on contact stiffness K, damping c and the Stribeck rate xi.

Writes sensitivity_K_c_xi.png. Each parameter goes over two decades about the seed's value; every
point is a periodic gait of its own, with elasticities d log(measure) / d log(parameter): 0.01 means
that one per cent more of the parameter makes the measure 0.01 per cent larger.
"""

import time
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from matplotlib.axes import Axes

import jaxbiped as jb

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


class Point(NamedTuple):
    """A gait with one parameter at `value`; NaN in all numbers of a gait where none was found.

    `elasticities` and their estimated `errors`, for each measure with respect to K, c and xi.
    """

    value: float
    outcome: str
    stable: bool
    residual: float
    measures: dict[str, float]
    elasticities: dict[str, list[float]]
    errors: dict[str, list[float]]


def swept(name: str, count: int, radius: bool) -> list[Point]:
    """Gaits from the seed's value outwards, each searched from its neighbour's state."""
    values = SEED[name] * np.logspace(-DECADES, DECADES, count)
    gaits = jb.gait_sweep(
        jb.seed_scene(), {name: values}, parameters=tuple(SEED), radius_sensitivities=radius
    )
    return [point(name, float(values[i]), gaits.isel({name: i})) for i in range(count)]


def point(name: str, value: float, gait: Any) -> Point:
    parameters = np.asarray(list((SEED | {name: value}).values()))

    def error(key: str) -> Any:
        return gait[f"sensitivity_error_{key}"].data * parameters / abs(float(gait[key]))

    return Point(
        value=value,
        outcome=str(jb.gait.Search(int(gait.ending))),
        stable=float(gait.spectral_radius) < 1.0,
        residual=float(gait.residual),
        measures={key: float(gait[key]) for key in MEASURES},
        elasticities={key: gait[f"elasticity_{key}"].data.tolist() for key in MEASURES},
        errors={key: error(key).tolist() for key in MEASURES},
    )


def own(name: str, points: list[Point], key: str, kind: str = "elasticities") -> np.ndarray:
    """Elasticities of a measure, or their errors, in the very parameter that is swept."""
    place = list(SEED).index(name)
    return np.asarray([getattr(p, kind)[key][place] for p in points])


def disagreement(name: str, points: list[Point], key: str) -> float | None:
    """Largest difference between a measure's change from point to point and what they promise.

    In the logarithm, the elasticities integrated by the trapezium rule; None without numbers.
    """
    steps = np.diff(np.log([p.value for p in points]))
    slopes = own(name, points, key)
    promised = 0.5 * steps * (slopes[1:] + slopes[:-1])
    open_ = np.abs(np.diff(np.log([p.measures[key] for p in points])) - promised)
    return None if np.all(np.isnan(open_)) else float(np.nanmax(open_))


def picture(options: Options, found: dict[str, list[Point]], keys: list[str]) -> None:
    """A row for each measure, a column for each parameter."""
    figure, grid = plt.subplots(
        len(keys), 3, figsize=(10.5, 1.0 + 1.9 * len(keys)), layout="constrained", sharex="col"
    )
    for column, (name, points) in enumerate(found.items()):
        for row, key in enumerate(keys):
            panel(grid[row, column], name, points, key)
        grid[0, column].set_title(f"with respect to {name}", fontsize=10)
        grid[-1, column].set_xlabel(f"{name} [{UNITS[name]}]")
    for row, key in enumerate(keys):
        grid[row, 0].set_ylabel(f"elasticity of\n{MEASURES[key]}")
    figure.suptitle(
        "d log(measure) / d log(parameter) of periodic gaits\n"
        "bars: estimated errors; dotted: the seed's value",
        fontsize=11,
    )
    options.save(figure, "sensitivity_K_c_xi.png")


def panel(axes: Axes, name: str, points: list[Point], key: str) -> None:
    values, errors = [p.value for p in points], own(name, points, key, "errors")
    # The radius's elasticity jumps where another multiplier becomes the largest: no line there.
    form = "o" if key == "spectral_radius" else "o-"
    axes.errorbar(values, own(name, points, key), errors, fmt=form, ms=3.5, capsize=2.0)
    axes.set_xscale("log")
    axes.axvline(SEED[name], color="#595959", linewidth=0.8, linestyle=":")
    axes.axhline(0.0, color="#595959", linewidth=0.8)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    axes.grid(alpha=0.3)


def report(options: Options, found: dict[str, list[Point]], keys: list[str]) -> None:
    for name, points in found.items():
        options.say()
        rows = (
            {name: p.value, "outcome": p.outcome, "stable": p.stable}
            | {key: own(name, points, key)[i] for key in keys}
            for i, p in enumerate(points)
        )
        formats = {name: ".2e"} | dict.fromkeys(keys, ".2e")
        options.table(rows, **formats, outcome="", stable="")


def main() -> None:
    options = parse(__doc__ or "")
    began = time.perf_counter()
    radius, count = not options.quick, QUICK_POINTS if options.quick else POINTS
    keys = [key for key in MEASURES if radius or key != "spectral_radius"]
    found = {name: swept(name, count, radius) for name in SEED}
    report(options, found, keys)
    missing = [
        {"parameter": name, "value": p.value, "outcome": p.outcome}
        for name, points in found.items()
        for p in points
        if p.outcome != str(jb.gait.Search.FOUND)
    ]
    options.say(f"\n{len(missing)} points without a gait, {time.perf_counter() - began:.0f} s")
    picture(options, found, keys)
    options.finish(
        {
            "parameters": list(SEED),
            "units": UNITS,
            "points": {name: [p._asdict() for p in points] for name, points in found.items()},
            "without_a_gait": missing,
            "disagreement_with_neighbours": {
                name: {key: disagreement(name, points, key) for key in keys}
                for name, points in found.items()
            },
        }
    )


if __name__ == "__main__":
    main()
