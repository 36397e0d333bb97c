"""Coverage of error bars: true errors of walks and gaits of random scenes against their bars.

Writes accuracy_coverage.png. Scenes are the seed's with parameters and start drawn at random, and
each accuracy a number drawn at random, of "named" gaits "balanced". References are ours at the
finest tolerance, of walks by Rodas4 and of gaits by Rodas4P, methods that neither the results nor
their bars come from; their own error is their difference from Rodas5P. Rigid walks are held against
the finest tolerance of their one method, whose error is the difference from a ten times looser one.
Scenes lie in accuracy_coverage.jsonl as they come: a run that was cut off goes on.
"""

import dataclasses
import warnings

import jax
import numpy as np
from _experiment import Options, experiment, label
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import legend_below, new_figure

SCENES = {"walks": 1000, "gaits": 1000, "rigid": 300, "named": 100, "named_rigid": 100}
QUICK_SCENES = {"walks": 6, "gaits": 1, "rigid": 20, "named": 1, "named_rigid": 2}
DURATION = 1.0
PARAMETERS = ("K", "c", "xi")
FINEST = 1e-11
SEED = 29
"""Not that of the draw (23) after which the bars' weights were chosen."""
VANISHING = 1e-6
"""Multipliers below this are zero to rounding, and their errors too: damping has wiped them out."""
MEASURES = ("period", "step_length", "speed", "peak_normal")
PANELS = {
    "Walks": ("walks", "rigid"),
    "Gaits": ("gaits",),
    "Gaits at the balanced accuracy": ("named", "named_rigid"),
}
"""The kinds of scenes that a panel of the picture shows."""


@dataclasses.dataclass(frozen=True)
class CoverageOptions(Options):
    """Options of the coverage."""

    seed: int = SEED
    """Of the draw."""


@experiment
def main(options: CoverageOptions):
    rows = options.store("accuracy_coverage", seed=options.seed)
    found = {}
    for place, (kind, one) in enumerate(KINDS.items()):
        found[kind] = []
        for index in tqdm(range(options.sized(SCENES, QUICK_SCENES)[kind]), unit=kind):
            random = np.random.default_rng((options.seed, place, index))
            found[kind].append(rows.row(f"{kind} {index}", one, random))
    pairs = {kind: _together(scenes) for kind, scenes in found.items()}
    every = {name: points for of_kind in pairs.values() for name, points in of_kind.items()}
    return {
        "seed": options.seed,
        **{kind: _counts(scenes) for kind, scenes in found.items()},
        "coverage": {name: _coverage(points) for name, points in every.items()},
        "picture": _draw(options, pairs),
    }


def _together(scenes):
    """Errors, bars and floors (n, 3) of each number, scene by scene."""
    pairs = {}
    for name, points in (each for scene in scenes for each in scene["pairs"].items()):
        pairs.setdefault(name, []).append(np.reshape(points, (-1, 3)))
    return pairs


def _around(random, value, spread, share=1.0):
    """A value up to that share of `spread`, in the logarithm, larger or smaller."""
    return float(value * spread ** (share * random.uniform(-1.0, 1.0)))


def _scene(random, spread):
    """The seed's scene, its parameters up to `spread` times larger or smaller."""
    return jb.seed_scene(
        slope=_around(random, 0.02, spread, 0.2),
        m=_around(random, 1.0, spread, 0.3),
        J=_around(random, 0.0096, spread, 0.1),
        K=_around(random, 1e6, spread),
        c=_around(random, 1e7, spread),
        v0=_around(random, 1e-4, spread, 0.5),
        xi=_around(random, 1000.0, spread),
        mu_static=float(random.uniform(0.5, 0.8)),
    )


def _quietly(run, *given, **how):
    """A result whose own record tells what a warning would."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return run(*given, **how)


def _walk(random):
    """True errors and bars of the state at the end of a walk."""
    scene, wanted = _scene(random, 5.0), 10.0 ** random.uniform(-6.0, -2.0)
    start = jb.seed_state()._replace(
        theta_1=-0.2479 + random.uniform(-0.03, 0.03), omega_1=-0.0052 + random.uniform(-0.1, 0.1)
    )
    how = dict(duration=DURATION, save=jb.HeelStrike())
    walk = _quietly(jb.simulate, scene, start, accuracy=wanted, **how)
    exact, checked = (
        jb.simulate(scene, start, solver=solver, rtol=FINEST, max_solver_steps=1 << 18, **how)
        for solver in ("rodas4", "rodas5p")
    )
    met, three, bars = walk.error.met, (walk, exact, checked), walk.error.bars
    counts = {int(each.arrivals.total) for each in three}
    same = walk.outcome == exact.outcome and len(counts) == 1
    last = jax.tree.map(lambda leaf: leaf[..., -1], bars["state"])
    pairs = {
        "state": _points(*(each.final for each in three), last),
        "heel strikes": _points(*(each.arrivals.t for each in three), bars["arrivals"].t),
        "states at heel strikes": _points(
            *(each.arrivals.state for each in three), bars["arrivals"].state
        ),
    }
    return _record(met, same, pairs if met and same else {})


def _rigid_scene(random):
    """The seed's masses and lengths, and the slope, larger or smaller."""
    spreads = {"m": (1.0, 2.0), "J": (0.0096, 1.5), "d": (0.1, 1.2), "r": (0.08, 1.3)}
    walker = jb.Walker(l=0.4, **{name: _around(random, *each) for name, each in spreads.items()})
    return jb.RigidScene(walker=walker, ground=jb.Ground(slope=_around(random, 0.02, 1.3)))


def _rigid(random):
    """True errors and bars of time and state at the end of a rigid walk."""
    scene = _rigid_scene(random)
    start = jb.dynamics.rigid_state(jb.seed_state())
    start = start._replace(
        omega_1=start.omega_1 + random.uniform(-0.3, 0.3),
        omega_2=start.omega_2 + random.uniform(-0.3, 0.3),
    )
    how = dict(duration=1.5) if random.uniform() < 0.5 else dict(footsteps=4)
    wanted = 10.0 ** random.uniform(-9.0, -2.0)
    walk = _quietly(jb.rigid_walk, scene, start, accuracy=wanted, **how)
    exact, checked = (jb.rigid_walk(scene, start, rtol=rtol, **how) for rtol in (1e-13, 1e-12))
    same = walk.outcome == exact.outcome
    # A fall is noticed at the end of a step, and so elsewhere by every tolerance.
    walks = same and walk.outcome is jb.Ending.WALKING
    ends = ((each.t[-1], *each.final) for each in (walk, exact, checked))
    bars = [bar[-1] for bar in (walk.error.bars["t"], *walk.error.bars["state"])]
    # What the walk was asked for itself has neither error nor bar.
    points = _points(*ends, bars)[1 if "duration" in how else 0 :]
    met = walk.error.met
    return _record(met, same, {"rigid state": points} if met and walks else {})


def _gait(random):
    """True errors and bars of a gait's measures, multipliers and sensitivities."""
    scene, wanted = _scene(random, 2.0), 10.0 ** random.uniform(-3.0, -1.5)
    how = dict(parameters=PARAMETERS, max_evaluations=40)
    gait = _quietly(jb.find_gait, scene, accuracy=wanted, **how)
    exact, checked = (
        jb.find_gait(scene, gait.measures.state, solver=solver, accuracy="tight", **how)
        for solver in ("rodas4p", "rodas5p")
    )
    three, bars = (gait, exact, checked), gait.error.bars
    found = all(each.outcome is jb.gait.Search.FOUND for each in three)
    if not found or not bars:
        return _record(False, True, {})

    def points(key, *names):
        told = *(getattr(each, key) for each in three), bars[key]
        return [row for n in names for row in _points(*(getattr(each, n) for each in told))]

    vanish = np.abs(exact.multipliers) < VANISHING
    told = *(each.multipliers for each in three), bars["multipliers"]
    pairs = {
        "period": points("measures", "period"),
        "other measures": points("measures", *MEASURES[1:]),
        "multipliers": _points(*(np.asarray(each)[~vanish] for each in told)),
        "multipliers of zero": _points(*(np.asarray(each)[vanish] for each in told)),
        "sensitivities": points("sensitivities", *MEASURES, "spectral_radius"),
    }
    return _record(gait.error.met, True, pairs)


def _named(scene, kind):
    """True errors and bars of derivatives by all parameters of a gait at "balanced"."""
    gait = _quietly(jb.find_gait, scene)
    exact, checked = (
        jb.find_gait(scene, gait.measures.state, solver=solver, accuracy="tight")
        for solver in ("rodas4p", "rodas5p")
    )
    three = (gait, exact, checked)
    if not all(each.outcome is jb.gait.Search.FOUND for each in three) or int(gait.grazes):
        return _record(False, True, {})
    slopes = *(each.sensitivities for each in three), gait.sensitivity_errors
    points = [
        row
        for name in (*MEASURES, "spectral_radius")
        for row in _points(*(getattr(each, name) for each in slopes))
    ]
    multipliers = (each.multipliers for each in three)
    pairs = {
        f"{kind}sensitivities by name": points,
        f"{kind}multipliers by name": _points(*multipliers, gait.multiplier_errors),
    }
    return _record(True, True, pairs)


def _record(met, same, pairs):
    return {"met": met, "silently_wrong": bool(met and not same), "pairs": pairs}


def _points(told, true, other, bars):
    """True errors of numbers that there are, their bars, and the errors of the truth."""
    flat = [
        np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(each)])
        for each in (told, true, other, bars)
    ]
    told, true, other, bars = (each[np.isfinite(flat[0])] for each in flat)
    return np.column_stack([np.abs(told - true), bars, np.abs(true - other)]).tolist()


def _counts(found):
    met, wrong = (sum(each[key] for each in found) for key in ("met", "silently_wrong"))
    return {"run": len(found), "met": met, "flagged": len(found) - met, "silently_wrong": wrong}


def _coverage(scenes):
    """How many true errors lie within their bars, where the reference can tell."""
    error, bar, own = np.concatenate(scenes).T
    judged, covered = _judged(error, bar, own)
    told = judged & (error > own)
    all_covered = [np.array_equal(*_judged(*points.T)) for points in scenes]
    return {
        "numbers": len(error),
        "resolved": int(judged.sum()),
        "covered": int(covered.sum()),
        "worst_ratio": float(np.max(error[judged] / bar[judged], initial=0.0)),
        "median_ratio": float(np.median(bar[told] / error[told])) if told.any() else None,
        "reference_floor_median": float(np.nanmedian(own)),
        "scenes": len(scenes),
        "scenes_all_covered": sum(all_covered),
    }


def _judged(error, bar, own):
    """Which errors the reference can tell: its own lies well below the bar, or they above both.

    And which of these lie within their bars.
    """
    judged = np.isfinite(error) & ((own <= 0.3 * bar) | (error > bar + 3.0 * own))
    return judged, judged & (error <= bar)


def _draw(options, pairs):
    """True errors over their bars: points above the line lie beyond their bars."""
    figure = new_figure(12.0, 4.8)
    panels = figure.subplots(1, len(PANELS), sharex=True, sharey=True)
    for ax, (title, kinds) in zip(panels, PANELS.items(), strict=True):
        for name, points in (each for kind in kinds for each in pairs[kind].items()):
            error, bar, _ = np.concatenate(points).T
            shown = (error > 0.0) & (bar > 0.0)
            ax.plot(bar[shown], error[shown], ".", markersize=2, label=name)
        ax.axline((1.0, 1.0), (2.0, 2.0), color="black", linewidth=0.8, label="error = bar")
        words = "error bar (SI units of the number)", "true error (SI units of the number)"
        label(ax, *words, title, log="xy")
        ax.label_outer()
        legend_below(ax, columns=2, markerscale=3.0)
    return options.save(figure, "accuracy_coverage.png")


KINDS = {
    "walks": _walk,
    "gaits": _gait,
    "rigid": _rigid,
    "named": lambda random: _named(_scene(random, 2.0), ""),
    "named_rigid": lambda random: _named(_rigid_scene(random), "rigid "),
}


if __name__ == "__main__":
    main()
