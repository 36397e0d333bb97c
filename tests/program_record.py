"""Programs of lanes that calls compile, written by one checkout and compared with another's.

    python -m tests.program_record write FILE [CALL ...]
    python -m tests.program_record compare FILE OTHER

Of each program: its operations an attempt by name, the numbers that it carries, and a hash of its
text for devices, which is the same on every processor. Of some calls also the attempted steps.
"""

import collections
import hashlib
import json
import os
import sys
import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb
from jaxbiped.compiler.runtime import _kernel
from tests.rigid_walkers import rigid_seed

SHARE_OF_OPERATIONS, SHARE_OF_ATTEMPTS = 0.01, 0.005
"""By which operations an attempt and attempts may differ."""


def starts(count=8192):
    """Starts of the seed's walker that differ in the stance leg's rate."""
    rates = jnp.linspace(1.0, 3.0, count)
    many = jax.tree.map(lambda leaf: jnp.full(count, leaf), jb.seed_state())
    return many._replace(omega_1=rates)


def rigid_gait(name):
    """A published walker's scene and a start on its gait."""
    scene = getattr(jb.models, name)()
    return scene, jb.find_gait(scene, parameters=(), radius_sensitivities=False).measures.state


def batch(accuracy):
    scene = jb.seed_scene(slope=0.02)
    how = dict(duration=2.0, save="end", accuracy=accuracy)
    walk = jax.vmap(lambda state: jb.simulate(scene, state, **how))(starts())
    return walk.accepted + walk.rejected


def rigid_batch(name):
    scene, state = rigid_gait(name)
    walk = jax.vmap(lambda turn: jb.simulate(
        scene, state._replace(**{state._fields[-1]: state[-1] * turn}), footsteps=3, save="end"
    ))(jnp.linspace(0.99, 1.01, 8192))  # fmt: skip
    return walk.accepted + walk.rejected


def slopes(scene, state):
    jax.jacfwd(lambda y: jb.simulate(scene, y, footsteps=2, save="end").final)(state)


def labels(scene):
    label = jb.labelling(scene)
    box = {"omega_swing": (-4.0, 5.0), "theta_swing": (-0.5, 0.8)}
    jb.sweep(label, jb.starts.sample(label.scene, box, 2000))


def compliant_walk(**how):
    jb.simulate(jb.seed_scene(slope=0.02), jb.seed_state(), duration=2.0, **how)


def rigid_walk(save):
    jb.simulate(*rigid_gait("garcia"), duration=8.0, save=save)


def optimum(scene):
    jb.optimise_gait(scene, vary={"d": (0.05, 0.2)}, maximise="speed", iterations=2)


CALLS = {
    "batch, draft": lambda: batch("draft"),
    "batch, balanced": lambda: batch("balanced"),
    "batch, tight": lambda: batch("tight"),
    "walk, steps": lambda: compliant_walk(save="steps"),
    "walk, strikes": lambda: compliant_walk(save=jb.HeelStrike()),
    "walk, mid-stance": lambda: compliant_walk(save=jb.MidStance()),
    "walk, extremes": lambda: compliant_walk(extremes=lambda scene, state: state.theta_1),
    "walk, slopes": lambda: slopes(jb.seed_scene(slope=0.02), jb.seed_state()),
    "gait": lambda: jb.find_gait(jb.seed_scene(slope=0.02)),
    "labels": lambda: labels(jb.seed_scene(slope=0.02)),
    "optimum": lambda: optimum(jb.seed_scene(slope=0.02)),
    "rigid gait": lambda: jb.find_gait(rigid_seed(0.02)),
    "rigid labels": lambda: labels(rigid_seed(0.02)),
    "rigid optimum": lambda: optimum(rigid_seed(0.02)),
    "rigid walk, times": lambda: rigid_walk(np.linspace(0.0, 1.0, 9)),
    "rigid walk, mid-stance": lambda: rigid_walk(jb.MidStance()),
    "rigid batch": lambda: rigid_batch("garcia"),
    "kneed batch": lambda: rigid_batch("hsu_chen"),
    "kneed gait": lambda: jb.find_gait(jb.models.hsu_chen()),
}


def programs_of(call):
    """Traces a call in an empty cache: its programs in the order of their hashes, and attempts."""
    traced, trace = [], _kernel.Kernel._trace

    def traced_by(kernel):
        traced.append(kernel)
        return trace(kernel)

    _kernel.Kernel._trace = traced_by
    try:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["JAXBIPED_CACHE"] = folder
            jb.clear_caches()
            steps = call()
    finally:
        _kernel.Kernel._trace = trace
    rows = [described(kernel) for kernel in traced]
    attempts = int(np.sum(steps)) if isinstance(steps, jax.Array) else None
    return {"programs": sorted(rows, key=lambda row: row["hash"]), "attempts": attempts}


def described(kernel):
    """What one program does in an attempt."""
    graph = kernel.graph
    counts = collections.Counter(value.op for value in graph.body.values)
    return {
        "hash": hashlib.sha256(kernel.device_text().encode()).hexdigest()[:16],
        "carried": sum(array.size for array in graph.carried),
        "operations": dict(sorted(counts.items())),
    }


def compare(known, found):
    """Prints what became of each call's programs; whether none has grown."""
    sound = True
    for name, old in known.items():
        new = found[name]
        same = [row["hash"] for row in new["programs"]] == [row["hash"] for row in old["programs"]]
        totals = [
            [sum(sum(row["operations"].values()) for row in each["programs"]),
             sum(row["carried"] for row in each["programs"])]
            for each in (old, new)
        ]  # fmt: skip
        steps = (old["attempts"], new["attempts"])
        moved = [] if None in steps else [abs(steps[1] / steps[0] - 1.0) <= SHARE_OF_ATTEMPTS]
        fits = [
            totals[1][0] <= (1.0 + SHARE_OF_OPERATIONS) * totals[0][0],
            totals[1][1] <= totals[0][1],
            *moved,
        ]
        sound = sound and all(fits)
        said = "the same text" if same else f"operations and carried {totals[0]} → {totals[1]}"
        worse = "" if all(fits) else "  WORSE"
        print(f"{name:>18}: {said}; attempts {steps[0]} → {steps[1]}{worse}")
    return sound


def main(how, *rest):
    """Writes a file or compares two; the exit code."""
    if how == "write":
        path, names = Path(rest[0]), rest[1:] or CALLS
        rows = json.loads(path.read_text()) if path.exists() else {}
        for name in names:
            print(f"{name} …", flush=True)
            rows[name] = programs_of(CALLS[name])
            path.write_text(json.dumps(rows, indent=1) + "\n")
        return 0
    known, found = (json.loads(Path(path).read_text()) for path in rest)
    return int(not compare(known, found))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
