"""Reproducibility: the same walks, labels and gait by vector widths, batch sizes, threads, engines.

Writes reproducibility.png. Each setting runs in a process of its own; all are held against lanes of
the host's width in one batch. Narrower vectors are code for the same CPU without its wider ones.
"""

import itertools
import json
import os
import subprocess
import sys
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from _batches import labelling_of, swept
from _experiment import Options, experiment, label
from _walks import scattered
from reference.compliant import numbers
from reference.scipy_solves import scales
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import legend, line_of, new_figure

WALKS, QUICK_WALKS = 1000, 40
BATCHES, QUICK_BATCHES = (1, 7, 64), (7,)
DURATION = 2.0
"""Of a walk [s]: five footsteps."""
SPREAD = 0.05
"""Starts lie about the seed's, by so much of its rates and angles."""
POINTS = 60
"""Of a line of the picture, at most, ever closer to the walks that differ most."""
LONGEST = 3600.0
"""No setting takes longer than this [s]."""


class Setting(NamedTuple):
    """What may change and should change nothing: engine, batch, vectors' bits, threads, start."""

    name: str
    engine: str
    batch: int
    bits: str = ""
    threads: str = "2"
    ulps: int = 0
    """Units in the last place by which a start's swing rate is another one."""
    flags: str = ""
    """Of XLA, beside those given."""
    sweeps: bool = True
    """Whether it labels starts and searches the gait, too."""


@experiment
def main(options: Options):
    count = options.sized(WALKS, QUICK_WALKS)
    settings = settings_of(count, quick=options.quick)
    found = [run(options, each, count) for each in tqdm(settings, desc="settings")]
    rows = [compared(each, own, found[0]) for each, own in zip(settings, found, strict=True)]
    return {"walks": count, "rows": rows, "picture": draw(options, rows)}


def settings_of(count, *, quick):
    """Of lanes and XLA; the first is what all are held against."""
    batches = QUICK_BATCHES if quick else BATCHES
    narrower = [("256", "1")] if quick else itertools.product(("256", "128"), ("1", "2"))
    found = [
        Setting("lanes", "lanes", count),
        *(
            Setting(f"lanes, {bits} bits, threads: {threads}", "lanes", count, bits, threads)
            for bits, threads in narrower
        ),
        Setting("lanes, threads: 1", "lanes", count, threads="1"),
        *(Setting(f"lanes, batches of {batch}", "lanes", batch) for batch in batches),
        Setting("lanes, start one ulp away", "lanes", count, ulps=1, sweeps=False),
        # Labels and the gait take XLA minutes to compile.
        Setting("XLA", "xla", count, sweeps=not quick),
    ]
    if quick:
        return found
    more = [Setting(f"XLA, batches of {batch}", "xla", batch, sweeps=False) for batch in batches]
    avx2 = "--xla_cpu_max_isa=AVX2"
    return [*found, *more, Setting("XLA, 256 bits", "xla", count, flags=avx2)]


def run(options, setting, count):
    """A setting's numbers, by a process of its own."""
    path = options.path("reproduced.npz")
    chosen = {
        "JAXBIPED_VECTOR_BITS": setting.bits,
        "JAXBIPED_THREADS": setting.threads,
        "XLA_FLAGS": f"{os.environ.get('XLA_FLAGS', '')} {setting.flags}".strip(),
    }
    command = [sys.executable, __file__, "one", str(path), json.dumps(setting), str(count)]
    subprocess.run(command, env=os.environ | chosen, check=True, timeout=LONGEST)
    with np.load(path) as kept:
        found = dict(kept)
    path.unlink()
    return found


def one(path, setting, count):
    """Walks, labels and the gait by one setting, into a file."""
    scene, setting, count = jb.seed_scene(), Setting(*json.loads(setting)), int(count)
    states, how = starts(count, setting.ulps), dict(engine=setting.engine)

    @jax.jit
    @jax.vmap
    def walked(state):
        return jb.simulate(scene, state, duration=DURATION, save="end", **how)

    ends, endings = [], []
    for first in range(0, count, setting.batch):
        # The last batch is filled up.
        of = np.minimum(np.arange(first, first + setting.batch), count - 1)
        found = walked(jax.tree.map(lambda leaf, of=of: leaf[of], states))
        ends.append(np.stack(jax.tree.leaves(found.final), axis=1))
        endings.append(np.asarray(found.ending))
    more = {}
    if setting.sweeps:
        chunk = max(setting.batch, count // 16)
        labels = swept(labelling_of("compliant", **how), count, chunk=chunk)()
        more["labels"] = labels["label"].values
        gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False, **how)
        more["period"] = np.asarray(gait.measures.period)
        more["multipliers"] = np.sort_complex(np.asarray(gait.multipliers))
    both = (np.concatenate(each)[:count] for each in (ends, endings))
    np.savez(path, **dict(zip(("ends", "endings"), both, strict=True)), **more)


def starts(count, ulps):
    """Random starts about the seed's, the same in every process."""
    moving = ("theta", "hip_v", "omega")
    found = scattered(jb.seed_state(), count, SPREAD, moving, seed=8)
    for _ in range(ulps):
        found = found._replace(omega_2=jnp.nextafter(found.omega_2, 0.0))
    return found


def apart(own, other):
    """Largest difference of each walk's end, in units of l, √(l/g) and radians."""
    return np.max(np.abs(own["ends"] - other["ends"]) / scales(numbers(), 8), axis=1)


def compared(setting, own, other):
    """How a setting's numbers differ from the first one's; walks that end alike are compared."""
    alike = own["endings"] == other["endings"]
    every = apart(own, other)
    differences = every[alike]
    row = {
        "name": setting.name,
        "same_bits": int(np.sum(np.all(own["ends"] == other["ends"], axis=1))),
        "endings": int(np.sum(~alike)),
        "largest": float(np.max(differences)),
        "median": float(np.median(differences)),
        "labels": None,
        "gait": None,
        "exceeded": exceeded(every) if np.any(every > 0.0) else None,
    }
    if setting.sweeps:
        period = float(abs(own["period"] / other["period"] - 1.0))
        multipliers = float(np.max(np.abs(own["multipliers"] - other["multipliers"])))
        row["labels"] = int(np.sum(own["labels"] != other["labels"]))
        row["gait"] = max(period, multipliers)
    return row


def exceeded(differences):
    """Points of a line: a difference, and the share of walks that differ by so much or more."""
    falling, count = np.sort(differences)[::-1].tolist(), len(differences)
    ranks = np.unique(np.geomspace(1, count, POINTS).astype(int)).tolist()
    return [[falling[rank - 1], rank / count] for rank in ranks]


def draw(options, rows):
    """How many walks differ by more than what, of the settings that differ at all."""
    ax = new_figure(6.4, 4.2).subplots()
    differing = [row for row in rows if row["exceeded"]]
    for k, row in enumerate(differing):
        ax.plot(*zip(*row["exceeded"], strict=True), label=row["name"], **line_of(k))
    same = len(rows) - len(differing) - 1
    words = "difference of the final state (relative)", "share of walks that differ by more (–)"
    label(ax, *words, f"{same} other settings: the same to the last bit", log="xy")
    legend(ax)
    return options.save(ax.figure, "reproducibility.png")


if __name__ == "__main__":
    one(*sys.argv[2:]) if sys.argv[1:2] == ["one"] else main()
