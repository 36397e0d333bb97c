"""The basin of the seed's walker: a slice, its boundary, its changes, the smallest fatal push.

Writes basin_seed.png, basin_seed_refined.png and basin_seed_along.png.
"""

import math
import time

import numpy as np
from _batches import AXES, OMEGA, THETA, UNITS, WALKING
from _experiment import Options, experiment

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
FARTHEST, TOLERANCE = 1.0, 1e-5
"""Of pushes: in units of 1 rad, speeds √(g l), rates √(g/l), and for the height the penetration."""
PUSHES = {
    "bisection alone": dict(gradients=False, improved=0),
    "turned to secants": dict(gradients=False),
    "turned to gradients": {},
}
CHANGED = {
    "slope": ("slope, α", "rad"),
    "K": ("stiffness, K", "N/m$^{1.5}$"),
    "c": ("damping, c", "N s/m$^2$"),
    "xi": ("friction's decay, ξ", "s/m"),
}
SEED = {"K": 1e6, "c": 1e7, "xi": 1e3}


@experiment
def main(options: Options):
    scene = jb.seed_scene(slope=SLOPE)
    labelling = jb.labelling(scene)
    codes, cycles = codes_on_grid(labelling, options.sized(SIDE, QUICK_SIDE))
    boundary = refined(labelling, *options.sized(COARSE, QUICK_COARSE))
    names, sizes = options.sized(list(CHANGED), ["c"]), options.sized(ALONG, QUICK_ALONG)
    changes = {name: along(scene, name, *sizes) for name in names}
    return {
        "slope": SLOPE,
        "fractions": {
            name: {"estimate": float(part.estimate), "low": part.low, "high": part.high}
            for name, part in jb.basins.fractions(jb.basins.label_names(codes, cycles)).items()
        },
        "boundary": {
            "all labels": measures(codes),
            "walking or not": measures((codes != WALKING).astype(int)),
        },
        "refined": {
            "asked": boundary.asked,
            "full": boundary.full,
            "walking": float((boundary.on_grid() == WALKING).mean()),
            **dimension_of(boundary),
        },
        "tolerances": tolerances(scene, options.sized(CHECKED, QUICK_CHECKED)),
        "pushes": [push(labelling, way) for way in PUSHES],
        "along": {name: of_change(each) for name, each in changes.items()},
        "pictures": draw(options, labelling, codes, cycles, boundary, changes),
    }


def axes(side):
    """Values along the two axes; the angle runs fastest."""
    return {"omega_swing": np.linspace(*OMEGA, side), "theta_swing": np.linspace(*THETA, side)}


def codes_on_grid(labelling, side):
    """Labels and cycles' footsteps of a square grid, shape (side, side)."""
    found = jb.sweep(labelling, jb.starts.grid(labelling.scene, axes(side)))
    return found["label"].values, found["cycle_footsteps"].values


def measures(codes):
    """Dimension, uncertainty exponent and entropy of a boundary."""
    uncertainty = jb.basins.uncertainty_exponent(codes)
    entropy = jb.basins.entropy(codes)
    return dimension_of(codes) | {
        "uncertainty_exponent": float(uncertainty.exponent),
        "uncertainty_error": float(uncertainty.error),
        "basin_entropy": entropy.basin,
        "boundary_entropy": entropy.boundary,
        "fractal_by_entropy": entropy.fractal,
    }


def dimension_of(boundary):
    dimension = jb.basins.boundary_dimension(boundary)
    return {"dimension": float(dimension.estimate), "dimension_error": float(dimension.error)}


def refined(labelling, cells, levels):
    """The slice's boundaries, halved so many times from a coarse grid."""
    lower, upper = zip(THETA, OMEGA, strict=True)
    label = jb.labels.label_at(labelling, ("theta_swing", "omega_swing"))
    cells = (cells, cells)
    return jb.basins.refine_boundary(label, lower, upper, cells, levels=levels, batch=16384)


def tolerances(scene, side):
    """How labels change with the tolerance, against the finest: which share, and where."""
    efforts = {name: jb.ACCURACIES[name].walk for name in ("draft", "balanced")}
    efforts |= {"1e-7": 1e-7, "1e-8": 1e-8}
    found = {
        name: codes_on_grid(jb.labelling(scene, rtol=rtol), side)[0]
        for name, rtol in efforts.items()
    }
    exact, rows = found["1e-8"], []
    for name, codes in found.items():
        changed, walks = codes != exact, codes == WALKING
        beside = changed & beside_boundary(exact)
        rows.append(
            {
                "accuracy": name,
                "changed": float(changed.mean()),
                "changed_beside_boundary": float(beside.sum() / changed.sum())
                if changed.any()
                else None,
                "walking": float(walks.mean()),
                "walking_changed": float((walks != (exact == WALKING)).mean()),
            }
        )
    return rows


def beside_boundary(codes):
    """Whether one of the eight points around a grid point has another label (boolean)."""
    padded = np.pad(codes, 1, mode="edge")
    rows, columns = codes.shape
    around = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.any([each != codes for each in around], axis=0)


def push(labelling, way):
    """The smallest push that takes the walker off its gait, by rays and what they are turned to."""
    began = time.perf_counter()
    how = dict(max_distance=FARTHEST, tolerance=TOLERANCE) | PUSHES[way]
    found = jb.labels.nearest_failure(labelling, **how)
    return {
        "way": way,
        "distance": found.distance,
        "angle": None if math.isnan(found.angle) else found.angle,
        "asked": found.asked,
        "seconds": time.perf_counter() - began,
        "direction": found.direction.tolist(),
        "push": dict(zip(jb.State._fields[1:], found.push.tolist(), strict=True)),
    }


def along(scene, name, count, side):
    """Fractions of the slice at slopes, or over a decade about the seed's value of a parameter.

    The slice keeps its angles and rates; what it does not name is the value's own gait's.
    """
    if name == "slope":
        values = np.linspace(0.010, 0.060, 2 * count - 1)
    else:
        values = SEED[name] * np.logspace(-0.5, 0.5, count)
    starts = jb.starts.grid(scene, {name: values} | axes(side))
    labelling = jb.labelling(scene, parameters=starts.parameters)
    found = jb.sweep(labelling, starts, look_for_gaits=name == "slope")
    labels, cycles = found["label"].values, found["cycle_footsteps"].values
    fractions = [*map(jb.basins.fractions, map(jb.basins.label_names, labels, cycles))]
    known = [bool(row) for row in labelling.family.rows]
    return {"values": values, "gait_known": known, "fractions": fractions}


def of_change(found):
    """Values, and the share of starts that walk at each, whatever the cycle, with its interval."""
    walking = []
    for fractions in found["fractions"]:
        total = sum(part.count for part in fractions.values())
        count = sum(part.count for name, part in fractions.items() if name.startswith("walking"))
        walking.append((count / total, *map(float, jb.basins.wilson_interval(count, total))))
    values, known = found["values"].tolist(), found["gait_known"]
    return {"values": values, "gait_known": known, "walking": walking}


def draw(options, labelling, codes, cycles, boundary, changes):
    omega, theta = axes(codes.shape[0]).values()
    state = labelling.family.states[0]
    shared = dict(names=AXES, units=UNITS, mark=(float(state.theta_1), float(state.omega_1)))
    title = f"The seed's walker at a slope of {SLOPE:g} rad"
    plane = plot.basin(codes, theta, omega, cycle_footsteps=cycles, title=title, **shared)
    halved = plot.refined_basin(boundary, cells=False, **shared)
    rows, columns = (len(changes) + 1) // 2, min(2, len(changes))
    figure = new_figure(6.5 * columns, 3.6 * rows)
    grid = figure.subplots(rows, columns, squeeze=False)
    for ax, (name, found) in zip(grid.ravel(), changes.items(), strict=True):
        shown, unit = CHANGED[name]
        how = dict(name=shown, unit=unit, log=name != "slope", ax=ax)
        plot.basin_fractions(found["values"], found["fractions"], **how)
    pictures = {"": plane, "_refined": halved, "_along": figure}
    return [options.save(each, f"basin_seed{end}.png") for end, each in pictures.items()]


if __name__ == "__main__":
    main()
