"""The seed's gait along stiffness K, damping c and Stribeck rate ξ, and where it loses stability.

Branches over decades, with what they end by; the fold and the period doubling along the slope,
followed in the planes (slope, K) and (slope, c). Writes k_c_xi_branches.png and
k_c_xi_curves.png.
"""

from typing import Any

from _options import Options, parse

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

RANGES = {"K": (1e4, 1e8), "c": (1e4, 1e9), "xi": (10.0, 1e5)}
QUICK_RANGES = {"K": (5e5, 2e6)}
PLANES = {"K": (1e5, 1e7), "c": (1e6, 1e8)}
QUICK_PLANES = {"K": (8e5, 1.25e6)}
SLOPES = (0.003, 0.11)


def main() -> None:
    options = parse(__doc__ or "")
    scene = jb.seed_scene()
    ranges = QUICK_RANGES if options.quick else RANGES
    branches = {
        name: jb.continue_gait(scene, name, bounds=bounds) for name, bounds in ranges.items()
    }
    rows = {name: numbers_of(options, branch) for name, branch in branches.items()}
    slope = jb.continue_gait(scene, "slope", bounds=SLOPES, max_points=120)
    planes = QUICK_PLANES if options.quick else PLANES
    curves = {name: curves_of(options, slope, name, bounds) for name, bounds in planes.items()}
    options.finish(
        {
            "branches": rows,
            "curves": {name: [points_of(each) for each in row] for name, row in curves.items()},
            "pictures": [draw_branches(options, branches), draw_curves(options, curves)],
        }
    )


def numbers_of(options: Options, branch: Any) -> dict[str, Any]:
    options.say(repr(branch))
    for stop in branch.stops:
        options.say(f"  at {branch.along} = {stop.value:.6g} {stop.end}: {stop.cause}")
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
        "ends": [[str(stop.end), stop.cause, stop.value] for stop in branch.stops],
        "stable": [point.stable for point in branch.points],
        "value": branch.values.tolist(),
    }


def curves_of(options: Options, slope: Any, name: str, bounds: tuple[float, float]) -> list[Any]:
    """The stable gaits' fold and period doubling in the plane of the slope and a parameter."""
    found = []
    for kind in ("fold", "period-doubling"):
        event = min(
            (each for each in slope.bifurcations if each.kind == kind),
            key=lambda each: abs(abs(each.point.multipliers[0]) - 1.0),
        )
        curve = jb.continuation.bifurcation_curve(
            slope, event, name, bounds=bounds, max_points=2 if options.quick else 40
        )
        found.append(curve)
        ends = ", ".join(f"{stop.end} at {stop.value:.4g} ({stop.cause})" for stop in curve.stops)
        options.say(f"{kind} along {name}: {len(curve.points)} points; {ends}")
    return found


def points_of(curve: Any) -> dict[str, Any]:
    return {
        "kind": str(curve.kind),
        "along": list(curve.along),
        "values": curve.values.tolist(),
        "off": [abs(abs(value) - 1.0) for value in curve.multipliers.tolist()],
        "errors": curve.errors.tolist(),
        "ends": [[str(stop.end), stop.cause, stop.value] for stop in curve.stops],
    }


def draw_branches(options: Options, branches: dict[str, Any]) -> str:
    figure = new_figure(5.4 * len(branches), 8.4)
    grid = figure.subplots(2, len(branches), squeeze=False)
    for column, branch in enumerate(branches.values()):
        plot.branch(branch, "step_length", ax=grid[0, column])
        plot.branch(branch, "spectral_radius", ax=grid[1, column])
        grid[1, column].set_ylim(0.0, 2.0)
        grid[1, column].set_title("")
        grid[0, column].get_legend().remove()
    return options.save(figure, "k_c_xi_branches.png")


def draw_curves(options: Options, curves: dict[str, list[Any]]) -> str:
    figure = new_figure(5.8 * len(curves), 4.8)
    axes = figure.subplots(1, len(curves), squeeze=False)[0]
    for ax, row in zip(axes, curves.values(), strict=True):
        plot.bifurcation_curves(row, ax=ax)
    return options.save(figure, "k_c_xi_curves.png")


if __name__ == "__main__":
    main()
