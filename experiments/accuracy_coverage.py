"""Coverage of error bars: true errors of walks and gaits of random scenes against their bars.

Writes accuracy_coverage.png. Scenes are the seed's with parameters and start drawn at random, and
each accuracy a number drawn at random. References are ours by Rodas4P at the finest tolerance, a
method that neither the results nor their bars come from. Its own error is the difference from
Rodas5P for walks, and for gaits the bars that every gait carries. Rigid walks are held against the
finest tolerance of their one method, whose error is the difference from a ten times looser one.
"""

import warnings
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb

WALKS, GAITS, RIGID = 300, 24, 300
QUICK_WALKS, QUICK_GAITS, QUICK_RIGID = 6, 1, 20
DURATION = 1.0
PARAMETERS = ("K", "c", "xi")
FINEST = 1e-11
SEED = 24
"""Not that of the draw (23) after which the bars' safety factor was chosen."""
MEASURES = ("period", "step_length", "speed", "peak_normal")


def main() -> None:
    options = parse("Coverage of error bars over random scenes.")
    random = np.random.default_rng(SEED)
    walks = _many(_walk, QUICK_WALKS if options.quick else WALKS, random, "walks")
    gaits = _many(_gait, QUICK_GAITS if options.quick else GAITS, random, "gaits")
    # A generator of their own: they can be drawn without the others.
    own = np.random.default_rng(SEED + 1)
    rigid = _many(_rigid, QUICK_RIGID if options.quick else RIGID, own, "rigid walks")
    every = (*walks, *gaits, *rigid)
    pairs: dict[str, list[list[float]]] = {}
    for found in every:
        for name, points in found["pairs"].items():
            pairs.setdefault(name, []).extend(points)
    coverage = {name: _coverage(np.array(points)) for name, points in pairs.items()}
    for name, row in coverage.items():
        scenes = [np.array(each["pairs"][name]) for each in every if name in each["pairs"]]
        rows = [_coverage(points) for points in scenes]
        row["scenes"] = len(rows)
        row["scenes_all_covered"] = sum(each["covered"] == each["resolved"] for each in rows)
    numbers = {
        "walks": _counts(walks),
        "gaits": _counts(gaits),
        "rigid": _counts(rigid),
        "coverage": coverage,
        "picture": str(_draw(options, pairs)),
    }
    for name, row in numbers["coverage"].items():
        options.say(
            f"{name}: all of them in {row['scenes_all_covered']} of {row['scenes']} scenes, "
            f"{row['covered']} of {row['resolved']} within their bars, "
            f"bars {row['median_ratio'] or float('nan'):.3g} times the error in the median"
        )
    options.finish(numbers)


def _many(one: Any, count: int, random: np.random.Generator, unit: str) -> list[dict[str, Any]]:
    return [one(random) for _ in tqdm(range(count), unit=unit)]


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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the record tells it, too
        walk = jb.simulate(scene, start, duration=DURATION, accuracy=wanted, save="end")
    exact, checked = (
        jb.simulate(
            scene,
            start,
            duration=DURATION,
            solver=solver,
            rtol=FINEST,
            save="end",
            max_solver_steps=1 << 18,
        )
        for solver in ("rodas4p", "rodas5p")
    )
    met, fell = walk.error.met, walk.outcome != exact.outcome
    told, true, other = (
        np.array([float(x) for x in each.final]) for each in (walk, exact, checked)
    )
    bars = np.array([float(np.ravel(bar)[-1]) for bar in walk.error.bars["state"]])
    points = np.column_stack([np.abs(told - true), bars, np.abs(true - other)])
    known = walk.error.met and not fell
    return {
        "met": met,
        "silently_wrong": bool(met and fell),
        "pairs": {"state": points.tolist()} if known else {},
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
    points = np.column_stack(
        [np.abs(told - true), [float(bar[-1]) for bar in bars], np.abs(true - other)]
    )
    # What the walk was asked for itself has neither error nor bar.
    points = points[1 if "duration" in how else 0 :]
    return {
        "met": met,
        "silently_wrong": bool(met and differs),
        "pairs": {"rigid state": points.tolist()} if met and walks else {},
    }


def _gait(random: np.random.Generator) -> dict[str, Any]:
    """True errors and bars of a gait's measures, multipliers and sensitivities."""
    scene, wanted = _scene(random, 2.0), 10.0 ** random.uniform(-3.0, -1.5)
    how: dict[str, Any] = dict(parameters=PARAMETERS, max_evaluations=40)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the record tells it, too
        gait = jb.find_gait(scene, accuracy=wanted, **how)
    exact = jb.find_gait(scene, gait.measures.state, accuracy="tight", solver="rodas4p", **how)
    found = gait.outcome is jb.gait.Search.FOUND and exact.outcome is jb.gait.Search.FOUND
    if not found or not gait.error.bars:
        return {"met": False, "silently_wrong": False, "pairs": {}}
    bars = gait.error.bars
    pairs: dict[str, list[list[float]]] = {}

    def add(name: str, told: Any, true: Any, bar: Any, own: Any) -> None:
        error = np.abs(np.asarray(told) - np.asarray(true))
        points = np.column_stack([np.ravel(each) for each in (error, bar, own)])
        pairs.setdefault(name, []).extend(points.tolist())

    for name in MEASURES:
        told, true, bar, own = (
            getattr(each, name)
            for each in (gait.measures, exact.measures, bars["measures"], exact.measure_errors)
        )
        add("period" if name == "period" else "other measures", told, true, bar, own)
    own = exact.multiplier_errors
    add("multipliers", gait.multipliers, exact.multipliers, bars["multipliers"], own)
    for name in (*MEASURES, "spectral_radius"):
        told, true, bar, own = (
            getattr(each, name)
            for each in (
                gait.sensitivities,
                exact.sensitivities,
                bars["sensitivities"],
                exact.sensitivity_errors,
            )
        )
        add("sensitivities", told, true, bar, own)
    return {"met": gait.error.met, "silently_wrong": False, "pairs": pairs}


def _counts(found: list[dict[str, Any]]) -> dict[str, int]:
    return {
        "run": len(found),
        "met": sum(each["met"] for each in found),
        "flagged": sum(not each["met"] for each in found),
        "silently_wrong": sum(each["silently_wrong"] for each in found),
    }


def _coverage(points: np.ndarray) -> dict[str, Any]:
    """How many true errors lie within their bars, where the reference can tell."""
    error, bar, own = points.T
    # The reference tells where its own floor lies well below the bar, or the error above both.
    judged = np.isfinite(error) & ((own <= 0.3 * bar) | (error > bar + 3.0 * own))
    covered = judged & (error <= bar)
    ratio = bar[judged & (error > own)] / error[judged & (error > own)]
    return {
        "numbers": len(points),
        "resolved": int(judged.sum()),
        "covered": int(covered.sum()),
        "share": float(covered.sum() / max(1, judged.sum())),
        "worst_ratio": float(np.max(error[judged] / bar[judged], initial=0.0)),
        "median_ratio": float(np.median(ratio)) if len(ratio) else None,
        "reference_floor_median": float(np.nanmedian(own)),
    }


def _draw(options: Options, pairs: dict[str, list[list[float]]]) -> Any:
    figure, ax = plt.subplots(figsize=(5.5, 5.0), layout="constrained")
    for name, points in pairs.items():
        error, bar, _ = np.array(points).T
        shown = (error > 0.0) & (bar > 0.0)
        ax.loglog(bar[shown], error[shown], ".", markersize=3, label=name)
    ends = np.array([1e-14, 1e2])
    ax.loglog(ends, ends, "k-", linewidth=0.8, label="error = bar")
    ax.set_xlabel("error bar [SI units of the number]")
    ax.set_ylabel("true error [SI units of the number]")
    ax.legend()
    path = options.path("accuracy_coverage.png")
    figure.savefig(path)
    plt.close(figure)
    return path


if __name__ == "__main__":
    main()
