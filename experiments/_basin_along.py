"""How the seed walker's basin changes with the slope and with the ground."""

from typing import Any

import _basin_slice
import numpy as np

import jaxbiped as jb

SEED = {"K": 1e6, "c": 1e7, "xi": 1e3}
UNITS = {"slope": "rad", "K": "N/m$^{1.5}$", "c": "N s/m$^2$", "xi": "s/m"}
SHOWN = {"slope": "slope, α", "K": "stiffness, K", "c": "damping, c", "xi": "friction's decay, ξ"}


def values_of(name: str, count: int) -> np.ndarray:
    """So many values of a parameter: slopes, or a decade about the seed's value."""
    if name == "slope":
        return np.linspace(0.010, 0.060, 2 * count - 1)
    return SEED[name] * np.logspace(-0.5, 0.5, count)


def along(name: str, count: int, side: int) -> dict[str, Any]:
    """Fractions of the slice at each value of a parameter, each value with its own gait.

    The slice keeps its angles and rates; what it does not name is the value's own gait's.
    """
    scene, values = jb.seed_scene(), values_of(name, count)
    starts = jb.starts.grid(scene, {name: values} | _basin_slice.axes(side))
    labelling = jb.labelling(scene, parameters=starts.parameters)
    known = [bool(row) for row in labelling.family.rows]
    found = jb.sweep(labelling, starts, look_for_gaits=name == "slope")
    labels, cycles = found["label"].values, found["cycle_footsteps"].values
    fractions = [
        jb.basins.fractions(jb.basins.label_names(labels[k], cycles[k])) for k in range(len(values))
    ]
    return {"values": values, "gait_known": known, "fractions": fractions}


def walking(fractions: dict[str, jb.basins.Fraction]) -> tuple[float, float, float]:
    """Fraction of starts that walk, whatever the cycle, with its interval."""
    total = sum(part.count for part in fractions.values())
    count = sum(part.count for name, part in fractions.items() if name.startswith("walking"))
    low, high = jb.basins.wilson_interval(count, total)
    return count / total, float(low), float(high)
