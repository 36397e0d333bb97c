"""The ladder of fidelity: what each model of the walker costs, and what it changes.

Writes ladder.png, cost per footstep against the gait's distance from the rung above, and
rigid_limit.png, how the seed's gait approaches the rigid walker's as its contact stiffens.
"""

import os

import jax
import numpy as np
from _experiment import Options, experiment
from _pictures import COLOURS, MARKERS
from _timing import seconds_of
from _walks import scattered

import jaxbiped as jb
from jaxbiped.plot.style import legend_below, new_figure

BATCH, QUICK_BATCH = 4096, 128
DURATION = 10.0
SPREAD = 0.01
"""Largest relative change of a component of the gait's state among the starts of a batch."""
EXACT = 1e-10
MOST_STEPS = 1_000_000
TOLERANCES = (1e-6, 1e-7, 1e-8)
"""Of the seed's laws; the rigid walker's are tried until its errors are as small."""
RIGID_TOLERANCES = tuple(float(x) for x in np.logspace(-4.0, -7.0, 13))
MEASURES = {
    "period": "period",
    "step_length": "step length",
    "speed": "speed",
    "spectral_radius": "radius",
}
SHOWN = ("period", "step_length", "spectral_radius")
WITNESSES = 64
"""Starts whose errors are measured."""
PATHS = {
    "K alone": lambda s: (s, 1.0),
    "c alone": lambda s: (1.0, s),
    "c with K^(2/3)": lambda s: (s, s ** (2.0 / 3.0)),
    "c with K": lambda s: (s, s),
    "c with K^(3/2)": lambda s: (s, s**1.5),
}
"""By how much K and c grow for a factor s."""
DOUBLINGS, QUICK_DOUBLINGS = 10, 4
LAST = 4
"""Points that the rate is fitted to."""


@experiment
def main(options: Options):
    # One of each kind: the creeping rung compiles as long as the seed's, and is of its kind.
    names = [name for name in jb.ladder() if name != "creep" or not options.quick]
    rungs = {name: (jb.ladder()[name], gait_of(jb.ladder()[name])) for name in names}
    measures = {name: measures_of(gait) for name, (_, gait) in rungs.items()}
    apart = {
        name: {key: measures[name][key] / measures[above][key] - 1.0 for key in MEASURES}
        for name, above in zip(names, [*names[1:], names[-1]], strict=True)
    }
    batch = options.sized(BATCH, QUICK_BATCH)
    first, *others = options.sized(TOLERANCES, TOLERANCES[:1])
    costs = {name: cost_of(*rungs[name], batch, [first]) for name in names if name != "rigid"}
    costs = {"rigid": rigid_cost(rungs, batch, costs["stribeck"])} | costs
    finer = [cost_of(*rungs["stribeck"], batch, [rtol]) for rtol in others]
    pairs = [(costs["stribeck"], costs["rigid"])]
    pairs += [(cost, rigid_cost(rungs, batch, cost)) for cost in finer]
    doublings = options.sized(DOUBLINGS, QUICK_DOUBLINGS)
    chosen = options.sized([*PATHS], [*PATHS][:2])
    paths = {path: approach(path, rungs["rigid"][1], doublings) for path in chosen}
    return {
        "threads": os.cpu_count(),
        "measures": measures,
        "distance_from_rung_above": apart,
        "costs": costs,
        "equal_errors": [
            {"stribeck": a, "rigid": b, "batch_ratio": a["batch_us"] / b["batch_us"]}
            for a, b in pairs
        ],
        "paths": paths,
        "pictures": [draw_rungs(options, apart, costs), draw_paths(options, paths)],
    }


def gait_of(scene):
    """The gait at heel strike, which every rung has."""
    return jb.find_gait(scene, section=jb.HeelStrike(), parameters=(), radius_sensitivities=False)


def measures_of(gait):
    """Measures of a gait, and its leading multipliers."""
    leading = np.asarray(gait.multipliers)[:3]
    return {name: float(getattr(gait.measures, name)) for name in MEASURES} | {
        "multipliers": [[float(value.real), float(value.imag)] for value in leading],
        "unit_multiplier_error": float(gait.unit_multiplier_error),
    }


def rigid_cost(rungs, batch, compliant):
    """Cost of the rigid walker at no larger an error than another one has."""
    return cost_of(*rungs["rigid"], batch, RIGID_TOLERANCES, error=compliant["error"])


def cost_of(scene, gait, batch, tolerances, *, error=np.inf):
    """What a footstep costs by lanes at the loosest tolerance that keeps to an error.

    `error`: median over the starts of the largest error of an angle or rate after ten seconds;
    `single_us`, `batch_us`: time of a footstep in one walk, and in a batch on all cores [µs].
    """
    # No compliant foot is lifted by it.
    starts = scattered(gait.measures.state, batch, SPREAD, ("theta", "omega"))
    some, one = (jax.tree.map(lambda leaf, at=at: leaf[at], starts) for at in (slice(WITNESSES), 0))
    exact = walked(scene, EXACT)(some)
    for rtol in tolerances:
        reached = error_of(walked(scene, rtol)(some), exact)
        if reached <= error:
            break
    alone, many = walked(scene, rtol, single=True), walked(scene, rtol)
    work = {"single": lambda: alone(one), "batch": lambda: many(starts)}
    seconds = {name: seconds_of({name: run}, 5, least=1.0)[name] for name, run in work.items()}
    footsteps = DURATION / float(gait.measures.period)
    single, together = seconds["single"] / footsteps, seconds["batch"] / (batch * footsteps)
    return dict(rtol=rtol, error=reached, single_us=1e6 * single, batch_us=1e6 * together)


def walked(scene, rtol, *, single=False):
    """A walk of ten seconds as a compiled function of its start; of a batch unless `single`."""

    def end(start):
        how = dict(rtol=rtol, save="end", max_solver_steps=MOST_STEPS, engine="lanes")
        walk = jb.simulate(scene, start, duration=DURATION, **how)
        return walk.final, walk.ending

    return jax.jit(end if single else jax.vmap(end))


def error_of(found, exact):
    """Of the walks that both count as walking."""
    (state, ending), (truth, true_ending) = found, exact
    walking = (np.asarray(ending) == 0) & (np.asarray(true_ending) == 0)
    names = [name for name in state._fields if name.startswith(("theta", "omega"))]
    gaps = [np.abs(np.asarray(getattr(state, n)) - np.asarray(getattr(truth, n))) for n in names]
    return float(np.median(np.max(gaps, axis=0)[walking]))


def approach(path, rigid, doublings):
    """Gaits along a path, each searched from the last one's state, beside the rigid gait.

    By measure the relative differences, and the exponents p of |difference| ∝ s^(−p) over the last
    points; `ended` says why no stiffer gait was found.
    """
    found, factors, guess, ended = [], [], None, None
    for factor in (2.0**k for k in range(doublings + 1)):
        stiffer, damped = PATHS[path](factor)
        scene = jb.seed_scene(K=1e6 * stiffer, c=1e7 * damped)
        gait = jb.find_gait(scene, guess, parameters=(), radius_sensitivities=False)
        if gait.outcome is not jb.gait.Search.FOUND:
            ended = f"at factor {factor:.0f}: {gait.outcome}"
            break
        guess = gait.measures.state
        factors.append(factor)
        found.append(gait.measures)
    gaps = {
        name: [float(getattr(m, name)) / float(getattr(rigid.measures, name)) - 1.0 for m in found]
        for name in SHOWN
    }
    rates = {name: rate(factors, gap) for name, gap in gaps.items()}
    peaks = [float(m.peak_normal) for m in found]
    return dict(factors=factors, **gaps, peak_normal=peaks, rates=rates, ended=ended)


def rate(factors, gaps):
    """The exponent with which the last differences shrink; None unless steadily, of one sign."""
    last = np.asarray(gaps[-LAST:])
    steady = bool(np.all(np.sign(last) == np.sign(last[0])) and np.all(np.diff(np.abs(last)) < 0.0))
    if len(last) < LAST or not steady:
        return None
    return float(-np.polyfit(np.log(factors[-LAST:]), np.log(np.abs(last)), 1)[0])


def draw_rungs(options, apart, costs):
    figure = new_figure(8.0, 4.2)
    left, right = figure.subplots(1, 2)
    names = list(costs)
    rows = np.arange(len(names))
    for k, (key, words) in enumerate({"single_us": "one walk", "batch_us": "in a batch"}.items()):
        left.plot([cost[key] for cost in costs.values()], rows, "o", color=COLOURS[k], label=words)
    left.set(xlabel="time for a footstep (µs)")
    left.set_title("Cost by lanes", loc="left")
    for key, marker, colour in zip(SHOWN, MARKERS, COLOURS, strict=False):
        values = [100.0 * abs(apart[name][key]) for name in names[:-1]]
        right.plot(values, rows[:-1], marker, color=colour, label=MEASURES[key])
    right.set(xlabel="distance from the rung above (%)")
    right.set_title("What the next rung changes", loc="left")
    for ax in (left, right):
        ax.set(xscale="log", ylim=(-0.5, len(names) - 0.5))
        ax.set_yticks(rows, names)
        ax.grid(axis="x", color="#DDDDDD")
        legend_below(ax, columns=3, columnspacing=1.0, handletextpad=0.2)
    return options.save(figure, "ladder.png")


def draw_paths(options, paths):
    figure = new_figure(9.0, 4.2)
    for ax, key in zip(figure.subplots(1, 3), SHOWN, strict=True):
        for (name, path), colour, marker in zip(paths.items(), COLOURS, MARKERS, strict=False):
            gaps, factors = np.asarray(path[key]), np.asarray(path["factors"])
            ax.plot(factors, np.abs(gaps), color=colour, linewidth=1.0, label=name)
            # Hollow where the compliant gait's measure is the larger one.
            for side, fill in ((gaps > 0.0, "white"), (gaps <= 0.0, colour)):
                look = dict(color=colour, markerfacecolor=fill, markersize=4)
                ax.plot(factors[side], np.abs(gaps[side]), marker, **look)
        ax.set_xscale("log", base=2)
        ax.set(yscale="log", xlabel="factor of the path, $s$")
        ax.set_title(MEASURES[key], loc="left")
        ax.grid(color="#DDDDDD")
    figure.axes[0].set_ylabel("distance from the rigid gait, relative")
    named = figure.axes[0].get_legend_handles_labels()
    figure.legend(*named, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle("Filled: below the rigid gait's; hollow: above it", fontsize=9)
    return options.save(figure, "rigid_limit.png")


if __name__ == "__main__":
    main()
