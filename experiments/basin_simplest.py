"""The basin of the simplest walker: a small, thin area, as Schwab and Wisse found it in 2001.

Starts are those just after a heel strike: both feet on the ground, the swing leg's rate from the
impact. Writes basin_simplest.png: above in the plane of stance angle and rate, below against
the rate that leads upright, so that the thin area can be seen.
"""

from typing import Any

import _basin_thin
import _simplest
import numpy as np
from _options import Options, parse

import jaxbiped as jb
from jaxbiped import plot
from jaxbiped.plot.style import new_figure

SLOPES = (0.004, 0.009)
SIDES, QUICK_SIDES = (200, 400), (100, 200)
TOLERANCES = {"draft": 1e-4, "balanced": 1e-6}
DRAWN, QUICK_DRAWN = 400, 100
CHECKED, QUICK_CHECKED = 300, 40
"""Starts that SciPy walks too, at each slope."""


def main() -> None:
    options = parse(__doc__ or "")
    sides = QUICK_SIDES if options.quick else SIDES
    checked = QUICK_CHECKED if options.quick else CHECKED
    found = {f"{slope:g}": basin_of(options, slope, sides, checked) for slope in SLOPES}
    picture = draw(options, QUICK_DRAWN if options.quick else DRAWN)
    options.finish({"slopes": found, "picture": picture})


def basin_of(options: Options, slope: float, sides: tuple[int, ...], checked: int) -> Any:
    """Fractions, reach and the independent check at a slope, said as they are found."""
    labellings = {
        name: _basin_thin.labelling_of(slope, rtol=rtol) for name, rtol in TOLERANCES.items()
    }
    best = labellings["balanced"]
    gait = _simplest.fixed_point(slope)
    apart = float(np.max(np.abs(best.family.rows[0][0].point[[1, 3]] - gait)))
    options.say(f"slope {slope:g}: gait at {gait.round(6)}, {apart:.0e} from the equations' own")
    rows = []
    for name, labelling in labellings.items():
        for side in sides:
            part = _basin_thin.fractions_of(labelling, side)
            rows.append({"accuracy": name, "side": side, **vars(part)})
    options.table(rows, accuracy="", side="d", estimate=".3%", low=".3%", high=".3%")
    reach = _basin_thin.reach(best, gait)
    for way, each in reach.items():
        options.say(f"from the gait, {way:<8} {each['distance']:.5f}, then {each['label']}")
    check = _basin_thin.compared(best, slope, checked)
    options.say(
        f"of {check['starts']} starts {check['walking']} walk, {check['walking_independently']} by "
        f"SciPy; {check['disagree']} disagree\n"
    )
    return {
        "gait": gait.tolist(),
        "gait_off": apart,
        "fractions": rows,
        "intervals_overlap": overlap(rows),
        "reach": reach,
        "check": check,
    }


def overlap(rows: list[dict[str, Any]]) -> bool:
    """Whether all the intervals have a value in common."""
    return max(row["low"] for row in rows) <= min(row["high"] for row in rows)


def draw(options: Options, side: int) -> str:
    figure = new_figure(13.0, 7.6)
    grid = figure.subplots(2, 2)
    for column, slope in enumerate(SLOPES):
        labelling = _basin_thin.labelling_of(slope)
        gait = _simplest.fixed_point(slope)
        draw_plane(grid[0, column], labelling, slope, gait, side)
        draw_strip(grid[1, column], labelling, slope, gait, side)
    return options.save(figure, "basin_simplest.png")


def draw_plane(ax: Any, labelling: jb.Labelling, slope: float, gait: np.ndarray, side: int) -> None:
    theta, rate = (np.linspace(*ends, side) for ends in (_basin_thin.THETA, _basin_thin.RATE))
    points = np.stack([each.ravel() for each in np.meshgrid(theta, rate)], axis=1)
    codes = _basin_thin.labels_at(labelling)(points).reshape(side, side)
    plot.basin(
        codes,
        theta,
        rate,
        names=("stance angle, θ", "its rate, θ̇"),
        units=("rad", "√(g/l)"),
        mark=(gait[0], gait[1]),
        title=f"Just after a strike, slope {slope:g} rad",
        ax=ax,
    )


def draw_strip(ax: Any, labelling: jb.Labelling, slope: float, gait: np.ndarray, side: int) -> None:
    theta, off, codes = _basin_thin.strip(labelling, slope, side)
    mark = float(gait[1] - _basin_thin.upright(gait[:1], slope)[0])
    plot.basin(
        codes,
        theta,
        1e3 * off,
        names=("stance angle, θ", "θ̇ less the rate that leads upright"),
        units=("rad", "10⁻³ √(g/l)"),
        mark=(gait[0], 1e3 * mark),
        title="The same, about the rate that leads upright",
        ax=ax,
    )


if __name__ == "__main__":
    main()
