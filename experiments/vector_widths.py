"""Same walks on other vectors, in other batches, and by the other engine: how far apart they end.

Draws nothing. Every instruction set of lanes runs in a process of its own, which takes this machine
for one without the wider sets; XLA runs on the machine as it is. Differences are of final states.
"""

import dataclasses
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from _options import Options
from tqdm import tqdm

SETS = {
    "AVX-512": ("avx512dq", "x86-64-v4", ()),
    "AVX2": ("avx2", "x86-64-v3", ("avx512", "avx10", "evex512")),
    "SSE": ("sse4.2", "x86-64-v2", ("avx", "fma", "f16c", "evex512", "vaes", "vpclmul", "xop")),
}
"""By name: a feature that it needs, LLVM's model of a CPU, and how features beyond it begin."""
BATCHES, QUICK_BATCHES = (1, 8, 4096), (1, 4)
DURATION, QUICK_DURATION = 2.0, 0.3
PERTURBATION = 1e-3


@dataclasses.dataclass(frozen=True)
class WidthOptions(Options):
    """Options of the comparison."""

    instructions: str = ""
    """Of the process that runs walks for one instruction set: its name."""


def main() -> None:
    options = tyro.cli(WidthOptions, description=__doc__)
    if options.instructions:
        _run_walks(options)
        return
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in tqdm(supported(), desc="instruction sets"):
            found[name] = _in_its_own_process(name, Path(folder), options.quick)
    names = list(found)
    numbers = {
        "lanes": _compared(found, names, "lanes"),
        "xla": _compared(found, names[:1], "xla"),
        "between_engines": _difference(found[names[0]], "lanes", "xla"),
        "error": _difference(found[names[0]], "lanes", "fine"),
    }
    for engine in ("lanes", "xla"):
        for row in numbers[engine]:
            options.say(f"{engine}: {row}")
    options.say(f"between engines: {numbers['between_engines']}; error: {numbers['error']}")
    options.finish(numbers)


def supported() -> list[str]:
    """The instruction sets of this machine, widest first; the first is the machine itself."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    return [name for name, (feature, *_) in SETS.items() if features.get(feature)]


def _in_its_own_process(name: str, folder: Path, quick: bool) -> dict[str, np.ndarray]:
    command = [sys.executable, __file__, "--instructions", name, "--out", str(folder)]
    subprocess.run(command + ["--quick"] * quick, check=True)
    with np.load(folder / f"{name}.npz") as kept:
        return dict(kept)


def pretend(name: str) -> None:
    """Takes this machine for one without the instruction sets wider than this one."""
    import llvmlite.binding as llvm

    _, cpu, without = SETS[name]
    features = llvm.get_host_cpu_features()
    for feature in list(features):
        if any(map(feature.startswith, without)):
            features[feature] = False
    llvm.get_host_cpu_features = lambda: features
    if without:
        llvm.get_host_cpu_name = lambda: cpu


def _run_walks(options: WidthOptions) -> None:
    """Walks by both engines in every size of batch, kept as arrays."""
    pretend(options.instructions)
    import jax
    import jax.numpy as jnp

    import jaxbiped as jb

    batches = QUICK_BATCHES if options.quick else BATCHES
    duration = QUICK_DURATION if options.quick else DURATION
    most = max(batches)
    noise = np.random.default_rng(0).standard_normal((most, 8))
    starts = np.array([float(x) for x in jb.seed_state()]) * (1.0 + PERTURBATION * noise)
    scene = jb.seed_scene()

    def program(engine: str, rtol: float | None = None) -> Any:
        def one(*start: Any) -> Any:
            how: dict[str, Any] = dict(save="end", engine=engine, rtol=rtol)
            walk = jb.simulate(scene, jb.State(*start), duration=duration, **how)
            return jnp.stack([*walk.final, walk.attempted.astype(float)])

        return jax.jit(jax.vmap(one))

    kept: dict[str, Any] = {"batches": np.array(batches)}
    # The first walks, as many as all sizes of batch have looked at.
    looked = sorted(batches)[-2]
    own = options.instructions == supported()[0]
    for engine in ("lanes", "xla") if own and not options.quick else ("lanes",):
        run = program(engine)
        for size in batches:
            if size == most:
                kept[f"{engine} {size}"] = np.asarray(run(*map(jnp.asarray, starts.T)))
                continue
            parts = [
                np.asarray(run(*map(jnp.asarray, starts[k : k + size].T)))
                for k in range(0, looked, size)
            ]
            kept[f"{engine} {size}"] = np.concatenate(parts)
    fine = program("lanes", 1e-10)(*map(jnp.asarray, starts[:64].T))
    kept["fine"] = np.asarray(fine)
    options.out.mkdir(parents=True, exist_ok=True)
    np.savez(options.path(f"{options.instructions}.npz"), **kept)


def _compared(found: dict[str, Any], names: list[str], engine: str) -> list[dict[str, Any]]:
    """Every instruction set and batch against the largest batch of the first set."""
    largest = int(found[names[0]]["batches"].max())
    if f"{engine} {largest}" not in found[names[0]]:
        return []
    against = found[names[0]][f"{engine} {largest}"]
    rows = []
    for name in names:
        for size in found[name]["batches"]:
            walks = found[name][f"{engine} {size}"]
            same = against[: len(walks)]
            change = np.abs(walks[:, :8] - same[:, :8]).max(axis=1)
            rows.append(
                {
                    "instructions": name,
                    "batch": int(size),
                    "walks": len(walks),
                    "identical": int(np.sum(np.all(walks == same, axis=1))),
                    "largest": float(change.max()),
                    "median": float(np.median(change)),
                    "other_steps": int(np.sum(walks[:, 8] != same[:, 8])),
                }
            )
    return rows


def _difference(found: dict[str, Any], one: str, other: str) -> dict[str, Any] | None:
    """Largest and median difference of two ways' final states, SI units, where both were run."""
    walks = [
        next((found[key] for key in (f"{way} {found['batches'].max()}", way) if key in found), None)
        for way in (one, other)
    ]
    if walks[0] is None or walks[1] is None:
        return None
    count = min(map(len, walks))
    change = np.abs(walks[0][:count, :8] - walks[1][:count, :8]).max(axis=1)
    return {"walks": count, "largest": float(change.max()), "median": float(np.median(change))}


if __name__ == "__main__":
    main()
