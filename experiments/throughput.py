"""Labelled starts per second: sizes of batches, models, engines, and peers.

Writes throughput.png. Runs that are compared take turns in one process, on two cores.
"""

# ruff: noqa: E402 (the cores are settled before JAX is imported)
import _cores

CORES = _cores.settle(2)

import functools

import _batches
import numpy as np
from _experiment import Options, draw_by, experiment
from reference.labels import by_numbalsoda, by_scipy
from reference.numbalsoda_solves import lsoda_address

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

SIZES, QUICK_SIZES = (1000, 10_000, 100_000, 1_000_000), (500, 2000)
COMPARED, QUICK_COMPARED = 4096, 256
"""Starts that peers label too."""
FEW = 8
"""Starts that SciPy labels."""
TOLERANCES = {"numbalsoda": 1e-5, "numbalsoda, finer": 1e-6}
WALKING, FELL_FORWARD, STUMBLED = (
    int(getattr(jb.basins.Label, name)) for name in ("WALKING", "FELL_FORWARD", "STUMBLED")
)


@experiment
def main(options: Options):
    rounds, sizes = options.sized(3, 1), options.sized(SIZES, QUICK_SIZES)
    models = options.sized(("compliant", "rigid"), ("compliant",))
    labellings = {model: _batches.labelling_of(model) for model in models}
    for labelling in labellings.values():
        _batches.swept(labelling, 256)()
    numbers = {
        "threads": CORES,
        "sizes": [row for each in labellings.items() for row in by_size(*each, sizes, rounds)],
        "peers": by_peer(labellings["compliant"], options.sized(COMPARED, QUICK_COMPARED), rounds),
        "engines": by_engine(*options.sized(("compliant", 512), ("rigid", 64))),
    }
    return numbers | {"picture": draw(options, numbers)}


def by_size(model, labelling, sizes, rounds):
    """Costs of a start, and what is left of them less the time of a sweep of a single start."""

    def seconds(size, often):
        return _batches.least_seconds({0: _batches.swept(labelling, size)}, often)[0]

    fixed = seconds(1, 3)
    for size in sizes:
        taken = seconds(size, rounds if size <= 100_000 else 1)
        yield {
            "model": model,
            "size": size,
            "fixed_s": fixed,
            "starts_per_s": size / taken,
            "us_each": 1e6 * taken / size,
            "us_less_fixed": 1e6 * (taken - fixed) / size,
        }


def by_peer(labelling, count, rounds):
    """The same starts by us, numbalsoda and SciPy: how fast, and how often the labels are equal.

    Of all the starts, then of those that walk, whose labels all ways are sure of equally soon.
    Starts that come to rest are left to numbalsoda: SciPy takes minutes.
    """
    batch = _batches.starts_of(labelling.scene, count).batch(labelling, 0, count)
    states = np.stack(list(map(np.asarray, batch.states)), axis=1)
    walking = states[labelling(batch.states).label == WALKING]
    rows = peers_on(labelling, "all", states, rounds, scipy=False)
    return rows + peers_on(labelling, "that walk", walking, rounds, scipy=True)


def peers_on(labelling, which, states, rounds, *, scipy):
    """Rows of a table; SciPy labels a few of the starts."""
    attractor, columns = labelling.family.rows[0][0], jb.State(*states.T.copy())
    ours = labelling(columns).label.astype(int)
    work = {"ours": lambda: labelling(columns).label}
    if lsoda_address() is not None:
        for name, rtol in TOLERANCES.items():
            work[name] = functools.partial(by_numbalsoda, states, attractor, rtol)
        by_numbalsoda(states[:2], attractor, 1e-5)
    seconds = _batches.least_seconds(work, rounds)
    rows = [compared(way, which, ours, work[way](), seconds[way]) for way in work]
    if scipy:
        few = functools.partial(by_scipy, states[:FEW], attractor, 1e-5)
        slow = _batches.least_seconds({0: few}, 1)[0]
        rows.append(compared("SciPy LSODA", which, ours[:FEW], few(), slow))
    return [row | {"of_ours": row["starts_per_s"] / rows[0]["starts_per_s"]} for row in rows]


def compared(way, which, ours, theirs, seconds):
    def fate(codes):
        """Labels, a stumble counted as a fall forward: from sampled states it looks like one."""
        return np.where(np.asarray(codes) == STUMBLED, FELL_FORWARD, codes)

    return {
        "way": way,
        "which": which,
        "starts": len(ours),
        "starts_per_s": len(ours) / seconds,
        "fates_agree": float((fate(ours) == fate(theirs)).mean()),
        "walking_agrees": float(((ours == WALKING) == (theirs == WALKING)).mean()),
    }


def by_engine(model, size):
    """Rates of both engines, and on how many of the same starts their labels agree."""
    rows, labels = [], {}
    for engine in ("lanes", "xla"):
        run = _batches.swept(_batches.labelling_of(model, engine=engine), size)
        labels[engine] = np.asarray(run().label)
        rate = size / _batches.least_seconds({0: run}, 2)[0]
        agree = float((labels[engine] == labels["lanes"]).mean())
        rows.append(dict(engine=engine, starts=size, starts_per_s=rate, labels_agree=agree))
    return rows


def draw(options, numbers):
    left, right = new_figure(9.0, 3.8).subplots(1, 2)
    draw_by(left, "model", numbers["sizes"], "size", "us_each")
    left.set(xlabel="starts in the batch", ylabel="time for a start (µs)")
    left.set(xscale="log", yscale="log")
    left.set_ylim(bottom=0.5 * min(row["us_each"] for row in numbers["sizes"]))
    left.grid(color="#DDDDDD")
    left.legend(frameon=False)
    peers = [row for row in numbers["peers"] if row["which"] == "that walk"]
    right.barh([row["way"] for row in peers], [row["starts_per_s"] for row in peers])
    right.set(xscale="log", xlabel="labelled starts that walk, a second")
    right.invert_yaxis()
    return options.save(left.figure, "throughput.png")


if __name__ == "__main__":
    main()
