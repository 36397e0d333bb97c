"""Reproducibility: the same walks, labels and gait by vector widths, batch sizes, threads, engines.

Writes reproducibility.png. Each setting runs in a process of its own; all are held against lanes of
the host's width in one batch. Narrower vectors are code for the same CPU without its wider ones.
"""

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from _batches import labelling_of, starts_of
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb

WALKS, QUICK_WALKS = 1000, 40
BATCHES, QUICK_BATCHES = (1, 7, 64), (7,)
DURATION = 2.0
"""Of a walk [s]: five footsteps."""
SPREAD = 0.05
"""Starts lie about the seed's, by so much of its rates and angles."""
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


def main() -> None:
    if len(sys.argv) > 1 and sys.argv[1] == "one":
        one(Path(sys.argv[2]), Setting(*json.loads(sys.argv[3])), int(sys.argv[4]))
        return
    options = parse(__doc__ or "")
    count = QUICK_WALKS if options.quick else WALKS
    settings = settings_of(count, quick=options.quick)
    found = [run(options, each, count) for each in tqdm(settings, desc="settings")]
    rows = [compared(each, own, found[0]) for each, own in zip(settings, found, strict=True)]
    for row in rows:
        options.say(
            f"{row['name']:36s}{row['same_bits']:6d} of {count} walks to the last bit, largest "
            f"difference {row['largest']:.1e}, median {row['median']:.1e}; {row['endings']} "
            f"endings differ"
        )
        if row["labels"] is not None:
            options.say(f"{'':36s}{row['labels']} labels differ; gait {row['gait']:.1e}")
    picture = draw(options, rows, [apart(own, found[0]) for own in found])
    options.finish({"walks": count, "rows": rows, "picture": picture})


def settings_of(count: int, *, quick: bool) -> list[Setting]:
    """Of lanes and XLA; the first is what all are held against."""
    found = [Setting("lanes", "lanes", count)]
    found += [
        Setting(f"lanes, {bits} bits, threads: {threads}", "lanes", count, bits, threads)
        for bits, threads in itertools.product(("256", "128"), ("1", "2"))
        if not quick or (bits, threads) == ("256", "1")
    ]
    found.append(Setting("lanes, threads: 1", "lanes", count, threads="1"))
    batches = QUICK_BATCHES if quick else BATCHES
    found += [Setting(f"lanes, batches of {batch}", "lanes", batch) for batch in batches]
    found.append(Setting("lanes, start one ulp away", "lanes", count, ulps=1, sweeps=False))
    # Labels and the gait take XLA minutes to compile.
    found.append(Setting("XLA", "xla", count, sweeps=not quick))
    if not quick:
        found += [
            Setting(f"XLA, batches of {batch}", "xla", batch, sweeps=False) for batch in batches
        ]
        avx2 = "--xla_cpu_max_isa=AVX2"
        found.append(Setting("XLA, 256 bits", "xla", count, flags=avx2))
    return found


def run(options: Options, setting: Setting, count: int) -> dict[str, np.ndarray]:
    """A setting's numbers, by a process of its own."""
    path = options.path("reproduced.npz")
    flags = f"{os.environ.get('XLA_FLAGS', '')} {setting.flags}".strip()
    chosen = {
        "JAXBIPED_VECTOR_BITS": setting.bits,
        "JAXBIPED_THREADS": setting.threads,
        "XLA_FLAGS": flags,
    }
    command = [sys.executable, __file__, "one", str(path), json.dumps(setting), str(count)]
    subprocess.run(command, env=os.environ | chosen, check=True, timeout=LONGEST)
    with np.load(path) as kept:
        found = dict(kept)
    path.unlink()
    return found


def one(path: Path, setting: Setting, count: int) -> None:
    """Walks, labels and the gait by one setting, into a file."""
    scene, states = jb.seed_scene(), starts(count, setting.ulps)

    def walk(state: jb.State) -> Any:
        return jb.simulate(scene, state, duration=DURATION, save="end", engine=setting.engine)

    walked = jax.jit(jax.vmap(walk))
    ends, endings = [], []
    for first in range(0, count, setting.batch):
        # The last batch is filled up.
        of = np.minimum(np.arange(first, first + setting.batch), count - 1)
        found = walked(jax.tree.map(lambda leaf, of=of: leaf[of], states))
        ends.append(np.stack(jax.tree.leaves(found.final), axis=1))
        endings.append(np.asarray(found.ending))
    more = {}
    if setting.sweeps:
        labelling = labelling_of("compliant", engine=setting.engine)
        chunk = max(setting.batch, count // 16)
        labels = jb.sweep(labelling, starts_of(scene, count), chunk=chunk, look_for_gaits=False)
        more["labels"] = labels["label"].values
        gait = jb.find_gait(scene, engine=setting.engine, parameters=(), radius_sensitivities=False)
        more["period"] = np.asarray(gait.measures.period)
        more["multipliers"] = np.sort_complex(np.asarray(gait.multipliers))
    np.savez(
        path, ends=np.concatenate(ends)[:count], endings=np.concatenate(endings)[:count], **more
    )


def starts(count: int, ulps: int) -> jb.State:
    """Random starts about the seed's, the same in every process."""
    random = np.random.default_rng(8)
    leaves = {}
    for name, leaf in jb.seed_state()._asdict().items():
        own = float(leaf) * (1.0 + SPREAD * random.uniform(-1.0, 1.0, count))
        leaves[name] = own if name not in ("hip_x", "hip_z") else np.full(count, float(leaf))
    for _ in range(ulps):
        leaves["omega_2"] = np.nextafter(leaves["omega_2"], 0.0)
    return jb.State(**{name: jnp.asarray(leaf) for name, leaf in leaves.items()})


def apart(own: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> np.ndarray:
    """Largest difference of each walk's end, in units of l, √(l/g) and radians."""
    scene = jb.seed_scene()
    length, gravity = float(scene.walker.l), float(scene.ground.g)
    time = np.sqrt(length / gravity)
    units = np.array([length] * 2 + [1.0] * 2 + [length / time] * 2 + [1.0 / time] * 2)
    return np.max(np.abs(own["ends"] - other["ends"]) / units, axis=1)


def compared(
    setting: Setting, own: dict[str, np.ndarray], other: dict[str, np.ndarray]
) -> dict[str, Any]:
    """How a setting's numbers differ from the first one's; walks that end alike are compared."""
    alike = own["endings"] == other["endings"]
    differences = apart(own, other)[alike]
    row = {
        "name": setting.name,
        "same_bits": int(np.sum(np.all(own["ends"] == other["ends"], axis=1))),
        "endings": int(np.sum(~alike)),
        "largest": float(np.max(differences)),
        "median": float(np.median(differences)),
        "labels": None,
        "gait": None,
    }
    if setting.sweeps:
        period = float(abs(own["period"] / other["period"] - 1.0))
        multipliers = float(np.max(np.abs(own["multipliers"] - other["multipliers"])))
        row["labels"] = int(np.sum(own["labels"] != other["labels"]))
        row["gait"] = max(period, multipliers)
    return row


def draw(options: Options, rows: list[dict[str, Any]], differences: list[np.ndarray]) -> str:
    """How many walks differ by more than what, of the settings that differ at all."""
    figure, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    for row, own in zip(rows, differences, strict=True):
        if np.any(own > 0.0):
            ax.loglog(np.sort(own)[::-1], np.arange(1, len(own) + 1) / len(own), label=row["name"])
    same = sum(not np.any(own > 0.0) for own in differences) - 1
    ax.set_title(f"{same} other settings: the same to the last bit")
    ax.set_xlabel("difference of the final state [relative]")
    ax.set_ylabel("share of walks that differ by more")
    ax.legend()
    return options.save(figure, "reproducibility.png")


if __name__ == "__main__":
    main()
