"""Numbers of the package, written by one checkout, Python or JAX and compared by another.

    python -m tests.number_record write FILE [SECTION ...]
    python -m tests.number_record compare FILE OTHER
    python -m tests.number_record time CHECKOUT CHECKOUT

Every number agrees to 1e-9 of its size, or of 1 where it is smaller. A program of another version
rounds elsewhere, so nothing is asked to be the same to the last bit. `time` runs the same work in
two checkouts in turns and prints medians of processor and wall time.
"""

import dataclasses
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed

AGREEMENT = 1e-9
FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1e3)
LAWS = ("threlfall", "coulomb", "smooth-bengisu-akay", "brown-mcphee")
"""Friction laws of which the first takes an exponential and the second a hyperbolic tangent."""
MEASURES = ("period", "step_length", "speed", "peak_normal", "spectral_radius")
BOUNDS = {"d": (0.05, 0.2), "r": (0.04, 0.12), "J": (0.003, 0.02)}


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


def gaits():
    """Measures, sizes of multipliers, elasticities, and the bars of all these."""
    for name, scene in scenes().items():
        gait = jb.find_gait(scene)
        yield (
            name,
            {
                "outcome": int(gait.ending),
                "measures": [getattr(gait.measures, each) for each in MEASURES],
                "bars": [getattr(gait.measure_errors, each) for each in MEASURES],
                "multipliers": np.sort(np.abs(gait.multipliers)),
                "elasticities": [getattr(gait.elasticities, each) for each in MEASURES],
            },
        )


def labels():
    """Two thousand starts of the compliant walker, and as many of the rigid one."""
    box = {"omega_swing": (-4.0, 5.0), "theta_swing": (-0.5, 0.8)}
    for name, scene in (("compliant", jb.seed_scene(slope=0.02)), ("rigid", rigid_seed(0.02))):
        label = jb.labelling(scene)
        found = jb.sweep(label, jb.starts.sample(label.scene, box, 2000))
        yield name, {each: found[each].values for each in ("label", "footsteps")}


def walks():
    """The ends of twenty walks at three accuracies."""
    start, rates = jb.seed_state(), np.linspace(1.0, 3.0, 20)
    for accuracy, rate in itertools.product(("draft", "balanced", "tight"), rates):
        state = start._replace(omega_1=rate)
        walk = jb.simulate(
            jb.seed_scene(slope=0.02), state, duration=2.0, accuracy=accuracy, save="end"
        )
        yield (
            f"{accuracy}, {rate:.3f} rad/s",
            {"ending": int(walk.ending), "t": walk.t, "state": list(walk.state)},
        )


def branches():
    """Ten branches: their points and bifurcations."""
    compliant = jb.seed_scene(slope=0.02)
    asked = [
        (rigid_seed(0.02), "slope", (0.01, 0.11)),
        (rigid_seed(0.02), "r", (0.05, 0.15)),
        (rigid_seed(0.02), "d", (0.06, 0.15)),
        (rigid_seed(0.02), "J", (0.004, 0.02)),
        (compliant, "slope", (0.012, 0.03)),
        (compliant, "K", (5e5, 5e6)),
        (compliant, "c", (5e6, 5e7)),
        (compliant, "xi", (500.0, 3000.0)),
        (compliant, "r", (0.06, 0.12)),
        (compliant, "J", (0.005, 0.015)),
    ]
    for scene, name, bounds in asked:
        branch = jb.continue_gait(scene, name, bounds=bounds)
        kind = "compliant" if scene.compliant else "rigid"
        yield (
            f"{kind}, {name}",
            {
                "values": [each.value for each in branch.points],
                "periods": [each.period for each in branch.points],
                "bifurcations": [each.value for each in branch.bifurcations],
            },
        )


def optima():
    """Five optima: their objective and variables."""
    asked = [
        (rigid_seed(0.02), "speed", ()),
        (rigid_seed(0.02), "speed", "spectral_radius<0.4"),
        (rigid_seed(0.03), "step_length", ()),
        (jb.seed_scene(slope=0.02), "speed", ()),
        (jb.seed_scene(slope=0.02), "step_length", "spectral_radius<0.6"),
    ]
    for k, (scene, objective, needs) in enumerate(asked):
        best = jb.optimise_gait(scene, vary=BOUNDS, maximise=objective, subject_to=needs)
        found = {"objective": best.objective, "variables": list(best.variables.values())}
        yield f"{k}: {objective} {needs or ''}", found


def fits():
    """Three fits: estimates and standard errors."""
    seen = {"period": (0.4438, 1e-4), "step_length": (0.1904, 1e-3)}
    for scene, name in ((rigid_seed(0.02), "J"), (rigid_seed(0.02), "d"), (rigid_seed(0.02), "r")):
        measured = jb.identify.MeasuredGait(seen, conditions={"slope": 0.02})
        fit = jb.fit_gait(scene, (name,), measured)
        yield name, {"found": [fit.estimates[name], fit.standard_errors[name]]}


def constraints():
    """The ends of a second's walk by the seven methods."""
    for name in jb.constraints.CONSTRAINT_METHODS:
        scene = jb.RedundantScene(jb.seed_scene(slope=0.02), name)
        walk = jb.simulate(scene, jb.seed_state(), duration=1.0, save="end", engine="lanes")
        yield name, {"ending": int(walk.ending), "state": jax.tree.leaves(walk.state)}


SECTIONS = dict(
    gaits=gaits,
    labels=labels,
    walks=walks,
    branches=branches,
    optima=optima,
    fits=fits,
    constraints=constraints,
)


def written(sections):
    """The numbers of some sections, as lists by section, name and kind."""

    def numbers(tree):
        return [float(x) for leaf in jax.tree.leaves(tree) for x in np.ravel(np.asarray(leaf))]

    found = {}
    for section in sections:
        print(f"{section} …", flush=True)
        found[section] = {
            name: {kind: numbers(tree) for kind, tree in row.items()}
            for name, row in SECTIONS[section]()
        }
    return found


def difference(old, new):
    """The largest difference of two lists, relative to sizes above 1; NaN equals NaN."""
    if len(old) != len(new):
        return np.inf
    old, new = np.asarray(old), np.asarray(new)
    if np.any(np.isnan(old) != np.isnan(new)):
        return np.inf
    apart = np.abs(old - new) / np.maximum(np.abs(old), 1.0)
    return float(np.nanmax(apart, initial=0.0))


def compare(known, found):
    """Prints how far apart the numbers of two files are; whether all agree."""
    worst = 0.0
    for section, rows in known.items():
        apart = {}
        for name, row in rows.items():
            for kind, old in row.items():
                size = difference(old, found[section][name][kind])
                apart[kind] = max(apart.get(kind, 0.0), size)
                if size > AGREEMENT:
                    print(f"  {section}, {name}: {kind} {size:.1e}")
        worst = max(worst, *apart.values())
        sizes = "  ".join(f"{kind} {size:.1e}" for kind, size in apart.items())
        print(f"{section}: {len(rows)} compared  {sizes}")
    print(f"Largest difference {worst:.1e}, {AGREEMENT:.0e} is allowed.")
    return worst <= AGREEMENT


def warm_times():
    """Processor time [s] of what runs again and again, medians of some runs."""
    scene, start = jb.seed_scene(slope=0.02), jb.seed_state()
    rates = jnp.linspace(1.0, 3.0, 8192)
    many = jax.tree.map(lambda leaf: jnp.full(8192, leaf), start)._replace(omega_1=rates)

    def batch():
        walk = jax.vmap(lambda state: jb.simulate(scene, state, duration=2.0, save="end"))(many)
        jax.block_until_ready(walk.t)

    work = {
        "batch of 8192": (batch, 5),
        "a walk": (lambda: jb.simulate(scene, start, duration=2.0, save="end"), 30),
        "a warm gait": (lambda: jb.find_gait(scene), 20),
    }
    found = {}
    for name, (run, count) in work.items():
        run()
        times = []
        for _ in range(count):
            begun = time.process_time()
            run()
            times.append(time.process_time() - begun)
        found[name] = statistics.median(times)
    return found


def time_in_turns(checkouts, rounds=3):
    """Prints medians of the same work in some checkouts, run in turns."""
    found = {checkout: {} for checkout in checkouts}
    for _, checkout in itertools.product(range(rounds), checkouts):
        with tempfile.TemporaryDirectory() as cache:
            place = os.environ | {"PYTHONPATH": checkout, "JAXBIPED_CACHE": cache}
            for name in ("first gait, wall", "second gait, wall"):
                begun = time.perf_counter()
                command = [sys.executable, "-m", "jaxbiped", "gait", "--json", "-"]
                subprocess.run(command, env=place, check=True, capture_output=True, cwd=checkout)
                found[checkout].setdefault(name, []).append(time.perf_counter() - begun)
            command = [sys.executable, __file__, "warm"]
            told = subprocess.run(
                command, env=place, check=True, capture_output=True, text=True, cwd=checkout
            )
            for name, took in json.loads(told.stdout).items():
                found[checkout].setdefault(name, []).append(took)
    for name in found[checkouts[0]]:
        row = "  ".join(f"{statistics.median(found[each][name]):9.4f}" for each in checkouts)
        print(f"{name:>20} {row} s")


def main(how, *rest):
    """Writes a file, compares two or times two checkouts; the exit code."""
    if how == "write":
        Path(rest[0]).write_text(json.dumps(written(rest[1:] or SECTIONS)))
        return 0
    if how == "warm":
        print(json.dumps(warm_times()))
        return 0
    if how == "time":
        time_in_turns([str(Path(each).resolve()) for each in rest])
        return 0
    known, found = (json.loads(Path(path).read_text()) for path in rest)
    return int(not compare(known, found))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
