"""The smallest push that takes the seed's walker off its gait, with and without gradients."""

import math
import time
from typing import Any

import jaxbiped as jb

COMPONENTS = jb.State._fields[1:]
FARTHEST, TOLERANCE = 1.0, 1e-5
"""In units of 1 rad, speeds √(g l), rates √(g/l), and for the height the foot's penetration."""


def pushes(labelling: jb.Labelling) -> list[dict[str, Any]]:
    """The smallest fatal push by rays alone, by rays turned to secants, and to gradients."""
    ways: dict[str, dict[str, Any]] = {
        "bisection alone": dict(gradients=False, improved=0),
        "turned to secants": dict(gradients=False),
        "turned to gradients": {},
    }
    rows = []
    for way, options in ways.items():
        began = time.perf_counter()
        found = jb.nearest_failure(labelling, max_distance=FARTHEST, tolerance=TOLERANCE, **options)
        seconds = time.perf_counter() - began
        rows.append(
            {
                "way": way,
                "distance": found.distance,
                "angle": None if math.isnan(found.angle) else found.angle,
                "asked": found.asked,
                "seconds": seconds,
                "direction": found.direction.tolist(),
                "push": dict(zip(COMPONENTS, found.push.tolist(), strict=True)),
            }
        )
    return rows
