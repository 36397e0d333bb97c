"""Forty gaits, written by one version of Python and JAX and compared by another.

    python -m tests.gait.version_agreement write FILE
    python -m tests.gait.version_agreement compare FILE OTHER

Measures agree to 1e-9 relative, multipliers and elasticities to 1e-9. A program of another version
rounds elsewhere, so nothing is asked to be the same to the last bit.
"""

import dataclasses
import itertools
import json
import sys
from pathlib import Path

import numpy as np

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed

AGREEMENT = 1e-9
FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1e3)
LAWS = ("threlfall", "coulomb", "smooth-bengisu-akay", "brown-mcphee")
"""Friction laws of which the first takes an exponential and the second a hyperbolic tangent."""


def scenes():
    """Forty of them by name."""
    found = {}
    for slope, K in itertools.product((0.014, 0.015, 0.02, 0.025, 0.03), (5e5, 1e6, 2e6)):
        found[f"slope {slope}, K {K:g}"] = jb.seed_scene(slope=slope, K=K)
    for slope, c in itertools.product((0.015, 0.02, 0.025), (5e6, 2e7)):
        found[f"slope {slope}, c {c:g}"] = jb.seed_scene(slope=slope, c=c)
    for law, slope in itertools.product(LAWS, (0.016, 0.022)):
        friction = jb.laws.friction_law_like(law, **FRICTION)
        found[f"{law}, slope {slope}"] = dataclasses.replace(
            jb.seed_scene(slope=slope), friction=friction
        )
    for slope in (0.012, 0.014, 0.016, 0.018, 0.02, 0.022, 0.024, 0.026, 0.028, 0.03, 0.032):
        found[f"rigid, slope {slope}"] = rigid_seed(slope)
    return found


def numbers(scene):
    """What is compared of a gait: measures, sizes of multipliers, elasticities."""
    gait = jb.find_gait(scene)
    names = ("period", "step_length", "speed", "peak_normal", "spectral_radius")
    elasticities = [getattr(gait.elasticities, name) for name in names]
    return {
        "outcome": str(gait.outcome),
        "measures": [float(getattr(gait.measures, name)) for name in names],
        "multipliers": [float(size) for size in np.sort(np.abs(gait.multipliers))],
        "elasticities": [float(x) for row in elasticities for x in np.ravel(row)],
    }


def differences(old, new):
    """The largest difference of each kind: of measures relative, of the others absolute."""
    measures = np.asarray(old["measures"]), np.asarray(new["measures"])
    found = {"measures": np.max(np.abs(measures[1] / measures[0] - 1.0))}
    for kind in ("multipliers", "elasticities"):
        found[kind] = np.nanmax(np.abs(np.asarray(old[kind]) - np.asarray(new[kind])))
    return found


def compare(known, found):
    """Prints how far apart the gaits of two files are; whether all agree."""
    worst = 0.0
    for name, old in known.items():
        apart = differences(old, found[name])
        same = old["outcome"] == found[name]["outcome"]
        worst = max(worst, *apart.values()) if same else np.inf
        print(f"{name:>28}  {old['outcome']} {found[name]['outcome']}  ", end="")
        print("  ".join(f"{kind} {size:.1e}" for kind, size in apart.items()))
    print(f"{len(known)} gaits: largest difference {worst:.1e}, {AGREEMENT:.0e} is allowed")
    return worst <= AGREEMENT


def main(how, *paths):
    """Writes a file or compares two; the exit code."""
    if how == "write":
        found = {name: numbers(scene) for name, scene in scenes().items()}
        Path(paths[0]).write_text(json.dumps(found))
        return 0
    known, found = (json.loads(Path(path).read_text()) for path in paths)
    return int(known.keys() != found.keys() or not compare(known, found))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
