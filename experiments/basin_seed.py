"""The basin of the seed's walker: a slice, its boundary, its changes, the smallest fatal push.

Writes basin_seed.png, basin_seed_refined.png and basin_seed_along.png.
"""

from typing import Any

import _basin_along
import _basin_push
import _basin_slice
import numpy as np
from _options import Options, parse

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

SLOPE = 0.02
SIDE, QUICK_SIDE = 200, 60
COARSE, QUICK_COARSE = (50, 4), (16, 3)
"""Cells of the refined boundary's coarse grid along each axis, and its levels."""
ALONG, QUICK_ALONG = (11, 60), (3, 24)
"""Values of a parameter, and points along each axis of the slice at each of them."""
CHECKED, QUICK_CHECKED = 80, 40


def main() -> None:
    options = parse(__doc__ or "")
    quick = options.quick
    labelling = jb.labelling(jb.seed_scene(slope=SLOPE))
    codes, cycles = _basin_slice.codes_on_grid(labelling, QUICK_SIDE if quick else SIDE)
    pictures = [draw_slice(options, labelling, codes, cycles)]
    numbers: dict[str, Any] = {"slope": SLOPE} | of_slice(options, codes, cycles)
    boundary = _basin_slice.refined(labelling, *(QUICK_COARSE if quick else COARSE))
    pictures.append(draw_refined(options, labelling, boundary))
    numbers["refined"] = of_refined(options, boundary)
    rows = _basin_slice.tolerances(labelling.scene, QUICK_CHECKED if quick else CHECKED)
    formats = dict(accuracy="", changed=".3%", changed_beside_boundary=".0%", walking=".3%")
    options.table(rows, **formats, walking_changed=".3%")
    numbers |= {"tolerances": rows, "pushes": _basin_push.pushes(labelling)}
    say_pushes(options, numbers["pushes"])
    names = ["c"] if quick else list(_basin_along.UNITS)
    sizes = QUICK_ALONG if quick else ALONG
    changes = {name: _basin_along.along(name, *sizes) for name in names}
    numbers["along"] = {name: of_change(options, name, each) for name, each in changes.items()}
    pictures.append(draw_along(options, changes))
    options.finish(numbers | {"pictures": pictures})


def of_slice(options: Options, codes: np.ndarray, cycles: np.ndarray) -> dict[str, Any]:
    fractions = jb.basins.fractions(jb.basins.label_names(codes, cycles))
    for name, part in fractions.items():
        options.say(f"{name:<18} {part.estimate:7.2%}  [{part.low:.2%}, {part.high:.2%}]")
    measures = _basin_slice.boundary_measures(codes)
    for name, each in measures.items():
        options.say(
            f"{name:<15} dimension {each['dimension']:.3f} ± {each['dimension_error']:.3f}, "
            f"uncertainty exponent {each['uncertainty_exponent']:.3f} ± "
            f"{each['uncertainty_error']:.3f}, basin entropy {each['basin_entropy']:.3f}, "
            f"of the boundary {each['boundary_entropy']:.3f}"
        )
    return {"fractions": _basin_slice.in_words(fractions), "boundary": measures}


def of_refined(options: Options, boundary: jb.basins.RefinedBoundary) -> dict[str, Any]:
    dimension = jb.basins.boundary_dimension(boundary)
    walking = float((boundary.on_grid() == int(jb.basins.Label.WALKING)).mean())
    options.say(
        f"refined: {boundary.asked} labels of {boundary.full}, dimension "
        f"{dimension.estimate:.3f} ± {dimension.error:.3f}, walking {walking:.2%}"
    )
    return {
        "asked": boundary.asked,
        "full": boundary.full,
        "dimension": float(dimension.estimate),
        "dimension_error": float(dimension.error),
        "walking": walking,
    }


def say_pushes(options: Options, rows: list[dict[str, Any]]) -> None:
    options.say("\nsmallest fatal push")
    options.table(rows, way="", distance=".6f", angle=".1e", asked="d", seconds=".2f")
    nearest = min(rows, key=lambda row: row["distance"])
    options.say("  ".join(f"{name} {value:+.2e}" for name, value in nearest["push"].items()))


def of_change(options: Options, name: str, found: dict[str, Any]) -> dict[str, Any]:
    walking = [_basin_along.walking(part) for part in found["fractions"]]
    options.say(f"\n{name:>10}  gait   walking")
    for k, value in enumerate(found["values"]):
        part, low, high = walking[k]
        known = "known" if found["gait_known"][k] else "met"
        options.say(f"{value:10.4g}  {known:5}  {part:.2%} [{low:.2%}, {high:.2%}]")
    return {
        "values": found["values"].tolist(),
        "gait_known": found["gait_known"],
        "walking": walking,
    }


def mark_of(labelling: jb.Labelling) -> tuple[float, float]:
    state = labelling.family.states[0]
    return float(state.theta_1), float(state.omega_1)


def draw_slice(
    options: Options, labelling: jb.Labelling, codes: np.ndarray, cycles: np.ndarray
) -> str:
    omega, theta = _basin_slice.axes(codes.shape[0]).values()
    figure = plot.basin(
        codes,
        theta,
        omega,
        cycle_footsteps=cycles,
        names=_basin_slice.AXES,
        units=_basin_slice.UNITS,
        mark=mark_of(labelling),
        title=f"The seed's walker at a slope of {SLOPE:g} rad",
    )
    return options.save(figure, "basin_seed.png")


def draw_refined(
    options: Options, labelling: jb.Labelling, boundary: jb.basins.RefinedBoundary
) -> str:
    figure = plot.refined_basin(
        boundary,
        names=_basin_slice.AXES,
        units=_basin_slice.UNITS,
        cells=False,
        mark=mark_of(labelling),
    )
    return options.save(figure, "basin_seed_refined.png")


def draw_along(options: Options, changes: dict[str, Any]) -> str:
    rows, columns = (len(changes) + 1) // 2, min(2, len(changes))
    figure = new_figure(6.5 * columns, 3.6 * rows)
    grid = figure.subplots(rows, columns, squeeze=False)
    for ax, (name, found) in zip(grid.ravel(), changes.items(), strict=True):
        plot.basin_fractions(
            found["values"],
            found["fractions"],
            name=_basin_along.SHOWN[name],
            unit=_basin_along.UNITS[name],
            log=name != "slope",
            ax=ax,
        )
    return options.save(figure, "basin_seed_along.png")


if __name__ == "__main__":
    main()
