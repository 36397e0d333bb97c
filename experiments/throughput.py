"""Labelled starts per second: sizes of batches, chunks, threads, models, engines, and peers.

Writes throughput.png. Runs that are compared take turns in one process, on two cores.
"""

# ruff: noqa: E402 (the cores are settled before JAX is imported)
import os

CORES = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
if CORES:
    os.sched_setaffinity(0, CORES[-2:])
os.environ.setdefault("NUMBA_NUM_THREADS", str(min(2, len(CORES) or 2)))

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import _batches
import numpy as np
from _options import Options, parse
from reference.labels import by_numbalsoda, by_scipy
from reference.numbalsoda_solves import lsoda_address

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

SIZES, QUICK_SIZES = (1000, 10_000, 100_000, 1_000_000), (500, 2000)
CHUNKS, QUICK_CHUNKS = (1024, 4096, 16384, 65536), (512, 2048)
COMPARED, QUICK_COMPARED = 4096, 256
"""Starts that peers label too."""
FEW = 8
"""Starts that SciPy labels."""
THREADS = "JAXBIPED_THREADS"
TOLERANCES = {"ours": 1e-5, "numbalsoda": 1e-5, "numbalsoda, finer": 1e-6}


def main() -> None:
    options = parse(__doc__ or "")
    quick = options.quick
    rounds = 1 if quick else 3
    models = ("compliant",) if quick else ("compliant", "rigid")
    labellings = {model: _batches.labelling_of(model) for model in models}
    for labelling in labellings.values():
        _batches.swept(labelling, 256)()
    sizes = QUICK_SIZES if quick else SIZES
    numbers: dict[str, Any] = {"threads": len(CORES[-2:])}
    numbers["sizes"] = by_size(options, labellings, sizes, rounds)
    chunks = QUICK_CHUNKS if quick else CHUNKS
    numbers["chunks"] = by_chunk(options, labellings, chunks, rounds)
    numbers["by_threads"] = by_threads(options, labellings, sizes[1], rounds)
    count = QUICK_COMPARED if quick else COMPARED
    numbers["peers"] = by_peer(options, labellings["compliant"], count, rounds)
    numbers["engines"] = by_engine(options, "rigid", 64) if quick else by_engine(options)
    options.finish(numbers | {"picture": draw(options, numbers)})


def by_size(
    options: Options, labellings: dict[str, jb.Labelling], sizes: tuple[int, ...], rounds: int
) -> list[dict[str, Any]]:
    """Costs of a start, and what is left of them less the time of a sweep of a single start."""
    rows = []
    for model, labelling in labellings.items():
        fixed = _batches.least_seconds({0: _batches.swept(labelling, 1)}, 3)[0]
        for size in sizes:
            often = rounds if size <= 100_000 else 1
            seconds = _batches.least_seconds({0: _batches.swept(labelling, size)}, often)[0]
            row = {
                "model": model,
                "size": size,
                "fixed_s": fixed,
                "starts_per_s": size / seconds,
                "us_each": 1e6 * seconds / size,
                "us_less_fixed": 1e6 * (seconds - fixed) / size,
            }
            rows.append(row)
    formats = dict(model="", size="d", starts_per_s=".0f", us_each=".2f", us_less_fixed=".2f")
    options.table(rows, **formats)
    return rows


def by_chunk(
    options: Options, labellings: dict[str, jb.Labelling], chunks: tuple[int, ...], rounds: int
) -> list[dict[str, Any]]:
    rows, size = [], chunks[-1]
    for model, labelling in labellings.items():
        work = {chunk: _batches.swept(labelling, size, chunk) for chunk in chunks}
        for chunk, seconds in _batches.least_seconds(work, rounds).items():
            rows.append({"model": model, "chunk": chunk, "starts_per_s": size / seconds})
    options.table(rows, model="", chunk="d", starts_per_s=".0f")
    return rows


def by_threads(
    options: Options, labellings: dict[str, jb.Labelling], size: int, rounds: int
) -> list[dict[str, Any]]:
    rows = []
    for model, labelling in labellings.items():
        run = _batches.swept(labelling, size)
        work = {threads: with_threads(threads, run) for threads in (1, 2)}
        for threads, seconds in _batches.least_seconds(work, rounds).items():
            rows.append({"model": model, "threads": threads, "starts_per_s": size / seconds})
    options.table(rows, model="", threads="d", starts_per_s=".0f")
    return rows


def with_threads(threads: int, run: Callable[[], Any]) -> Callable[[], Any]:
    def limited() -> None:
        with environment(THREADS, str(threads)):
            run()

    return limited


@contextlib.contextmanager
def environment(name: str, value: str) -> Iterator[None]:
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def by_peer(
    options: Options, labelling: jb.Labelling, count: int, rounds: int
) -> list[dict[str, Any]]:
    """The same starts by us, numbalsoda and SciPy: how fast, and how often the labels are equal.

    Of all the starts, then of those that walk, whose labels all ways are sure of equally soon, and
    of those that fall. Starts that come to rest are left to numbalsoda: SciPy takes minutes.
    """
    batch = _batches.starts_of(labelling.scene, count).batch(labelling, 0, count)
    states = np.stack(list(map(np.asarray, batch.states)), axis=1)
    codes = labelling(batch.states).label
    walking = np.flatnonzero(codes == int(jb.basins.Label.WALKING))
    falling = np.flatnonzero(codes == int(jb.basins.Label.FELL_FORWARD))
    rows = peers_on(labelling, "all", states, rounds, scipy=False)
    rows += peers_on(labelling, "that walk", states[walking], rounds, scipy=True)
    rows += peers_on(labelling, "that fall", states[falling], rounds, scipy=True)
    options.table(
        rows, way="", starts="d", which="", starts_per_s=".0f", of_ours=".4f", fates_agree=".1%",
        walking_agrees=".1%",
    )  # fmt: skip
    return rows


def peers_on(
    labelling: jb.Labelling, which: str, states: np.ndarray, rounds: int, *, scipy: bool
) -> list[dict[str, Any]]:
    """Rows of a table; SciPy labels a few of the starts."""
    attractor = labelling.family.rows[0][0]
    columns = jb.State(*states.T.copy())
    ours = labelling(columns).label.astype(int)
    work: dict[str, Callable[[], np.ndarray]] = {"ours": lambda: labelling(columns).label}
    if lsoda_address() is not None:
        for name in ("numbalsoda", "numbalsoda, finer"):
            work[name] = lambda rtol=TOLERANCES[name]: by_numbalsoda(states, attractor, rtol)
        by_numbalsoda(states[:2], attractor, 1e-5)
    seconds = _batches.least_seconds(work, rounds)
    rows = [compared(way, which, ours, work[way](), seconds[way]) for way in work]
    if scipy:
        few: dict[Any, Any] = {0: lambda: by_scipy(states[:FEW], attractor, 1e-5)}
        slow = _batches.least_seconds(few, 1)[0]
        rows.append(compared("SciPy LSODA", which, ours[:FEW], few[0](), slow))
    return [row | {"of_ours": row["starts_per_s"] / rows[0]["starts_per_s"]} for row in rows]


def compared(
    way: str, which: str, ours: np.ndarray, theirs: np.ndarray, seconds: float
) -> dict[str, Any]:
    walks, walked = ours == int(jb.basins.Label.WALKING), theirs == int(jb.basins.Label.WALKING)
    return {
        "way": way,
        "which": which,
        "starts": len(ours),
        "starts_per_s": len(ours) / seconds,
        "fates_agree": float((fate(ours) == fate(theirs)).mean()),
        "walking_agrees": float((walks == walked).mean()),
    }


def fate(codes: np.ndarray) -> np.ndarray:
    """Labels, a stumble counted as a fall forward: from sampled states it looks like one."""
    stumbled = np.asarray(codes) == int(jb.basins.Label.STUMBLED)
    return np.where(stumbled, int(jb.basins.Label.FELL_FORWARD), codes)


def by_engine(options: Options, model: str = "compliant", size: int = 512) -> list[dict[str, Any]]:
    """Rates of both engines, and on how many of the same starts their labels agree."""
    rows, labels = [], {}
    for engine in ("lanes", "xla"):
        run = _batches.swept(_batches.labelling_of(model, engine=engine), size)
        labels[engine] = np.asarray(run().label)
        seconds = _batches.least_seconds({0: run}, 2)[0]
        agree = float((labels[engine] == labels["lanes"]).mean())
        row = {"engine": engine, "starts": size, "starts_per_s": size / seconds}
        rows.append(row | {"labels_agree": agree})
    options.table(rows, engine="", starts_per_s=".0f", labels_agree=".1%")
    return rows


def draw(options: Options, numbers: dict[str, Any]) -> str:
    figure = new_figure(9.0, 3.8)
    left, right = figure.subplots(1, 2)
    for model, marker in (("compliant", "o"), ("rigid", "s")):
        picked = [row for row in numbers["sizes"] if row["model"] == model]
        costs = [row["us_each"] for row in picked]
        left.loglog([row["size"] for row in picked], costs, marker + "-", label=model)
    left.set_xlabel("starts in the batch")
    left.set_ylabel("time for a start (µs)")
    left.set_ylim(bottom=0.5 * min(row["us_each"] for row in numbers["sizes"]))
    left.grid(color="#DDDDDD")
    left.legend(frameon=False)
    peers = [row for row in numbers["peers"] if row["which"] == "that walk"]
    right.barh([row["way"] for row in peers], [row["starts_per_s"] for row in peers])
    right.set_xscale("log")
    right.set_xlabel("labelled starts that walk, a second")
    right.invert_yaxis()
    return options.save(figure, "throughput.png")


if __name__ == "__main__":
    main()
