"""Coverage of error bars: true errors of walks and gaits of random scenes against their bars.

Writes accuracy_coverage.png. Scenes are the seed's with parameters and start drawn at random, and
each accuracy a number drawn at random. References are ours at the finest tolerance, of walks by
Rodas4 and of gaits by Rodas4P, methods that neither the results nor their bars come from; their own
error is their difference from Rodas5P. Rigid walks are held against the finest tolerance of their
one method, whose error is the difference from a ten times looser one. Scenes lie in
accuracy_coverage.jsonl as they come: a run that was cut off goes on.
"""

import dataclasses
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np
import tyro
from _options import Options
from tqdm import tqdm

import jaxbiped as jb

SCENES = {"walks": 1000, "gaits": 1000, "rigid": 300}
QUICK_SCENES = {"walks": 6, "gaits": 1, "rigid": 20}
DURATION = 1.0
PARAMETERS = ("K", "c", "xi")
FINEST = 1e-11
SEED = 29
"""Not that of the draw (23) after which the bars' weights were chosen."""
VANISHING = 1e-6
"""Multipliers below this are zero to rounding, and their errors too: damping has wiped them out."""
MEASURES = ("period", "step_length", "speed", "peak_normal")


@dataclasses.dataclass(frozen=True)
class CoverageOptions(Options):
    """Options of the coverage."""

    seed: int = SEED
    """Of the draw."""


def main() -> None:
    options = tyro.cli(CoverageOptions, description="Coverage of error bars over random scenes.")
    store = options.path(f"accuracy_coverage{'_quick' if options.quick else ''}.jsonl")
    walks, gaits, rigid = (_many(store, options, one, kind) for kind, one in KINDS.items())
    every = (*walks, *gaits, *rigid)
    names = dict.fromkeys(name for each in every for name in each["pairs"])
    pairs = {
        name: [np.reshape(each["pairs"][name], (-1, 3)) for each in every if name in each["pairs"]]
        for name in names
    }
    numbers = {
        "seed": options.seed,
        "walks": _counts(walks),
        "gaits": _counts(gaits),
        "rigid": _counts(rigid),
        "coverage": {name: _coverage(scenes) for name, scenes in pairs.items()},
        "picture": _draw(options, pairs),
    }
    for name, row in numbers["coverage"].items():
        options.say(
            f"{name}: all of them in {row['scenes_all_covered']} of {row['scenes']} scenes, "
            f"{row['covered']} of {row['resolved']} within their bars, "
            f"bars {row['median_ratio'] or float('nan'):.3g} times the error in the median"
        )
    options.finish(numbers)


def _many(
    store: Path, options: CoverageOptions, one: Callable[..., dict[str, Any]], kind: str
) -> list[dict[str, Any]]:
    """Scenes of a kind, each with random numbers of its own, from the store or measured."""
    lines = store.read_text().splitlines() if store.exists() else []
    known = {
        entry["index"]: entry["found"]
        for entry in map(json.loads, lines)
        if (entry["kind"], entry["seed"]) == (kind, options.seed)
    }
    count = (QUICK_SCENES if options.quick else SCENES)[kind]
    with store.open("a") as file:
        for index in tqdm(range(count), unit=kind):
            if index not in known:
                place = (options.seed, list(KINDS).index(kind), index)
                known[index] = one(np.random.default_rng(place))
                entry = {"kind": kind, "seed": options.seed, "index": index, "found": known[index]}
                file.write(json.dumps(entry) + "\n")
                file.flush()
    return [known[index] for index in range(count)]


def _scene(random: np.random.Generator, spread: float) -> jb.Scene:
    """The seed's scene, its parameters up to `spread` times larger or smaller."""

    def around(value: float, share: float = 1.0) -> float:
        return float(value * spread ** (share * random.uniform(-1.0, 1.0)))

    return jb.seed_scene(
        slope=around(0.02, 0.2),
        m=around(1.0, 0.3),
        J=around(0.0096, 0.1),
        K=around(1e6),
        c=around(1e7),
        v0=around(1e-4, 0.5),
        xi=around(1000.0),
        mu_static=float(random.uniform(0.5, 0.8)),
    )


def _walk(random: np.random.Generator) -> dict[str, Any]:
    """True errors and bars of the state at the end of a walk."""
    scene, wanted = _scene(random, 5.0), 10.0 ** random.uniform(-6.0, -2.0)
    start = jb.seed_state()._replace(
        theta_1=-0.2479 + random.uniform(-0.03, 0.03), omega_1=-0.0052 + random.uniform(-0.1, 0.1)
    )
    how: dict[str, Any] = dict(duration=DURATION, save=jb.HeelStrike())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the record tells it, too
        walk = jb.simulate(scene, start, accuracy=wanted, **how)
    exact, checked = (
        jb.simulate(scene, start, solver=solver, rtol=FINEST, max_solver_steps=1 << 18, **how)
        for solver in ("rodas4", "rodas5p")
    )
    met, fell = walk.error.met, walk.outcome != exact.outcome
    same = not fell and len({int(each.arrivals.total) for each in (walk, exact, checked)}) == 1
    bars = walk.error.bars
    pairs = {
        "state": _points(*(each.final for each in (walk, exact, checked)), _last(bars["state"])),
        "heel strikes": _points(
            *(each.arrivals.t for each in (walk, exact, checked)), bars["arrivals"].t
        ),
        "states at heel strikes": _points(
            *(each.arrivals.state for each in (walk, exact, checked)), bars["arrivals"].state
        ),
    }
    return {
        "met": met,
        "silently_wrong": bool(met and not same),
        "pairs": pairs if met and same else {},
    }


def _rigid(random: np.random.Generator) -> dict[str, Any]:
    """True errors and bars of time and state at the end of a rigid walk."""

    def around(value: float, spread: float) -> float:
        return float(value * spread ** random.uniform(-1.0, 1.0))

    walker = jb.Walker(
        m=around(1.0, 2.0), J=around(0.0096, 1.5), l=0.4, d=around(0.1, 1.2), r=around(0.08, 1.3)
    )
    scene = jb.RigidScene(walker=walker, ground=jb.Ground(slope=around(0.02, 1.3)))
    start = jb.dynamics.rigid_state(jb.seed_state())
    start = start._replace(
        omega_1=start.omega_1 + random.uniform(-0.3, 0.3),
        omega_2=start.omega_2 + random.uniform(-0.3, 0.3),
    )
    how: dict[str, Any] = dict(duration=1.5) if random.uniform() < 0.5 else dict(footsteps=4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the record tells it, too
        walk = jb.rigid_walk(scene, start, accuracy=10.0 ** random.uniform(-9.0, -2.0), **how)
    exact, checked = (jb.rigid_walk(scene, start, rtol=rtol, **how) for rtol in (1e-13, 1e-12))
    met, differs = walk.error.met, walk.outcome != exact.outcome
    # A fall is noticed at the end of a step, and so elsewhere by every tolerance.
    walks = walk.outcome is jb.Ending.WALKING and not differs
    told, true, other = (
        np.array([float(x) for x in (each.t[-1], *each.final)]) for each in (walk, exact, checked)
    )
    bars = (walk.error.bars["t"], *walk.error.bars["state"])
    points = _points(told, true, other, np.array([float(bar[-1]) for bar in bars]))
    # What the walk was asked for itself has neither error nor bar.
    points = points[1 if "duration" in how else 0 :]
    return {
        "met": met,
        "silently_wrong": bool(met and differs),
        "pairs": {"rigid state": points} if met and walks else {},
    }


def _gait(random: np.random.Generator) -> dict[str, Any]:
    """True errors and bars of a gait's measures, multipliers and sensitivities."""
    scene, wanted = _scene(random, 2.0), 10.0 ** random.uniform(-3.0, -1.5)
    how: dict[str, Any] = dict(parameters=PARAMETERS, max_evaluations=40)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the record tells it, too
        gait = jb.find_gait(scene, accuracy=wanted, **how)
    again: dict[str, Any] = dict(accuracy="tight", **how)
    exact, checked = (
        jb.find_gait(scene, gait.measures.state, solver=solver, **again)
        for solver in ("rodas4p", "rodas5p")
    )
    found = all(each.outcome is jb.gait.Search.FOUND for each in (gait, exact, checked))
    if not found or not gait.error.bars:
        return {"met": False, "silently_wrong": False, "pairs": {}}
    bars, three = gait.error.bars, (gait, exact, checked)
    pairs: dict[str, list[list[float]]] = {}
    for name in MEASURES:
        kind = "period" if name == "period" else "other measures"
        numbers = *(each.measures for each in three), bars["measures"]
        pairs.setdefault(kind, []).extend(_points(*(getattr(each, name) for each in numbers)))
    vanish = np.abs(exact.multipliers) < VANISHING
    for name, chosen in (("multipliers", ~vanish), ("multipliers of zero", vanish)):
        numbers = *(each.multipliers for each in three), bars["multipliers"]
        pairs[name] = _points(*(np.asarray(each)[chosen] for each in numbers))
    for name in (*MEASURES, "spectral_radius"):
        numbers = *(each.sensitivities for each in three), bars["sensitivities"]
        points = _points(*(getattr(each, name) for each in numbers))
        pairs.setdefault("sensitivities", []).extend(points)
    return {"met": gait.error.met, "silently_wrong": False, "pairs": pairs}


def _last(state: Any) -> Any:
    return state._replace(**{name: leaf[..., -1] for name, leaf in state._asdict().items()})


def _points(told: Any, true: Any, other: Any, bars: Any) -> list[list[float]]:
    """True errors of numbers that there are, their bars, and the errors of the truth."""
    flat = [
        np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(each)])
        for each in (told, true, other, bars)
    ]
    told, true, other, bars = (each[np.isfinite(flat[0])] for each in flat)
    return np.column_stack([np.abs(told - true), bars, np.abs(true - other)]).tolist()


def _counts(found: list[dict[str, Any]]) -> dict[str, int]:
    return {
        "run": len(found),
        "met": sum(each["met"] for each in found),
        "flagged": sum(not each["met"] for each in found),
        "silently_wrong": sum(each["silently_wrong"] for each in found),
    }


def _coverage(scenes: list[np.ndarray]) -> dict[str, Any]:
    """How many true errors lie within their bars, where the reference can tell."""
    error, bar, own = np.concatenate(scenes).T
    judged, covered = _judged(error, bar, own)
    told = judged & (error > own)
    all_covered = [np.array_equal(*_judged(*points.T)) for points in scenes]
    return {
        "numbers": len(error),
        "resolved": int(judged.sum()),
        "covered": int(covered.sum()),
        "share": float(covered.sum() / max(1, judged.sum())),
        "worst_ratio": float(np.max(error[judged] / bar[judged], initial=0.0)),
        "median_ratio": float(np.median(bar[told] / error[told])) if told.any() else None,
        "reference_floor_median": float(np.nanmedian(own)),
        "scenes": len(scenes),
        "scenes_all_covered": sum(all_covered),
    }


def _judged(error: Any, bar: Any, own: Any) -> tuple[Any, Any]:
    """Which errors the reference can tell: its own lies well below the bar, or they above both.

    And which of these lie within their bars.
    """
    judged = np.isfinite(error) & ((own <= 0.3 * bar) | (error > bar + 3.0 * own))
    return judged, judged & (error <= bar)


def _draw(options: Options, pairs: dict[str, list[np.ndarray]]) -> str:
    figure, ax = plt.subplots(figsize=(5.5, 5.0), layout="constrained")
    for name, points in pairs.items():
        error, bar, _ = np.concatenate(points).T
        shown = (error > 0.0) & (bar > 0.0)
        ax.loglog(bar[shown], error[shown], ".", markersize=3, label=name)
    ends = np.array([1e-14, 1e2])
    ax.loglog(ends, ends, "k-", linewidth=0.8, label="error = bar")
    ax.set_xlabel("error bar [SI units of the number]")
    ax.set_ylabel("true error [SI units of the number]")
    ax.legend()
    return options.save(figure, "accuracy_coverage.png")


KINDS: dict[str, Callable[[np.random.Generator], dict[str, Any]]] = {
    "walks": _walk,
    "gaits": _gait,
    "rigid": _rigid,
}


if __name__ == "__main__":
    main()
