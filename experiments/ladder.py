"""The ladder of fidelity: what each model of the walker costs, and what it changes.

Writes ladder.png, cost per footstep against the gait's distance from the rung above; and how gaits
approach those on rigid feet as contacts stiffen, rigid_limit.png of the seed's walker, and
kneed_limit.png of McGeer's walker with knees.
"""

import os

import jax
import numpy as np
from _experiment import Options, experiment
from _mechanisms import kneed
from _timing import seconds_of
from _walks import scattered

import jaxbiped as jb
from jaxbiped.plot.style import COLOURS, MARKERS, legend_below, new_figure

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
PLAIN = dict(parameters=(), radius_sensitivities=False)
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
KNEED_PATHS = {"c with K": 1.0, "c with K^(3/2)": 1.5}
"""By which power of the factor the damping c grows, of feet and stops; K grows as the factor."""
KNEED_FACTORS, QUICK_KNEED_FACTORS = (1.0, 4.0, 16.0, 64.0, 256.0), (1.0, 4.0, 16.0)
KNEED_MEASURES = {
    "period": "period",
    "step_length": "step length",
    "pair": "leading pair of multipliers",
    "third": "third multiplier",
}


@experiment
def main(options: Options):
    # One of each kind: the creeping rung compiles as long as the seed's, and is of its kind.
    names = [name for name in jb.ladder() if name != "creep" or not options.quick]
    scenes = {name: jb.ladder()[name] for name in names}
    # At heel strike, which every rung has.
    gaits = {name: jb.find_gait(s, section=jb.HeelStrike(), **PLAIN) for name, s in scenes.items()}
    rungs = {name: (scenes[name], gaits[name]) for name in names}
    measures = {name: measures_of(gait) for name, gait in gaits.items()}
    apart = {
        name: {key: measures[name][key] / measures[above][key] - 1.0 for key in MEASURES}
        for name, above in zip(names, [*names[1:], names[-1]], strict=True)
    }
    batch = options.sized(BATCH, QUICK_BATCH)
    first, *others = options.sized(TOLERANCES, TOLERANCES[:1])
    costs = {name: cost_of(*rungs[name], batch, [first]) for name in names if name != "rigid"}
    finer = [cost_of(*rungs["stribeck"], batch, [rtol]) for rtol in others]
    # The rigid walker at no larger an error.
    rigid = [
        cost_of(*rungs["rigid"], batch, RIGID_TOLERANCES, error=cost["error"])
        for cost in (costs["stribeck"], *finer)
    ]
    pairs = zip((costs["stribeck"], *finer), rigid, strict=True)
    costs = {"rigid": rigid[0]} | costs
    doublings = options.sized(DOUBLINGS, QUICK_DOUBLINGS)
    chosen = options.sized([*PATHS], [*PATHS][:2])
    paths = {path: approach(path, gaits["rigid"], doublings) for path in chosen}
    walked = with_knees(
        options.sized([*KNEED_PATHS], [*KNEED_PATHS][1:]),
        options.sized(KNEED_FACTORS, QUICK_KNEED_FACTORS),
    )
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
        "kneed": walked,
        "pictures": [
            draw_rungs(options, apart, costs),
            draw_paths(options, paths),
            draw_kneed(options, walked["distances"]),
        ],
    }


def measures_of(gait):
    """Measures of a gait, and its leading multipliers."""
    leading = np.asarray(gait.multipliers)[:3]
    return {name: float(getattr(gait.measures, name)) for name in MEASURES} | {
        "multipliers": [[float(value.real), float(value.imag)] for value in leading],
        "unit_multiplier_error": float(gait.unit_multiplier_error),
    }


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


def followed(scenes, guess=None):
    """Gaits of scenes by factor, each searched from the last one's state; and why they end."""
    found = {}
    for factor, scene in scenes.items():
        gait = jb.find_gait(scene, guess, **PLAIN)
        if gait.outcome is not jb.gait.Search.FOUND:
            return found, f"at factor {factor:.0f}: {gait.outcome}"
        guess, found[factor] = gait.measures.state, gait
    return found, None


def approach(path, rigid, doublings):
    """Gaits along a path beside the rigid gait.

    By measure the relative differences, and the exponents p of |difference| ∝ s^(−p) over the last
    points; `ended` says why no stiffer gait was found.
    """
    grown = {s: PATHS[path](s) for s in (2.0**k for k in range(doublings + 1))}
    scenes = {s: jb.seed_scene(K=1e6 * K, c=1e7 * c) for s, (K, c) in grown.items()}
    gaits, ended = followed(scenes)
    factors, found = list(gaits), [gait.measures for gait in gaits.values()]
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


def with_knees(paths, factors):
    """Gaits of the kneed walker along paths, and how far they are from the one on rigid feet."""
    soft = jb.models.mcgeer(knees=True)
    values = {name: float(x) for name, x in jb.parameter_values(soft).items()}
    start = soft.state(**jb.models.MODELS["mcgeer-kneed"].starts["gait"])
    rigid = numbers_of(jb.find_gait(jb.RigidScene(kneed(), soft.ground), **PLAIN))

    def stiffer(factor, power):
        grown = {name: values[name] * factor for name in ("K", "stop.K")}
        grown |= {name: values[name] * factor**power for name in ("c", "stop.c")}
        return jb.with_parameters(soft, grown)

    def away(row, name):
        """Lengths and times are relative to the rigid gait's."""
        scale = rigid[name] if name in SHOWN else 1.0
        return float(np.linalg.norm(np.subtract(row[name], rigid[name])) / scale)

    found = {path: {s: stiffer(s, KNEED_PATHS[path]) for s in factors} for path in paths}
    found = {path: followed(scenes, start)[0] for path, scenes in found.items()}
    rows = {
        path: [{"factor": factor} | numbers_of(gait) for factor, gait in gaits.items()]
        for path, gaits in found.items()
    }
    distances = {
        path: [row | {name: away(row, name) for name in KNEED_MEASURES} for row in own]
        for path, own in rows.items()
    }
    return {"rigid": rigid, "paths": rows, "distances": distances}


def numbers_of(gait):
    """Measures of a gait: of its leading pair of multipliers real and imaginary part."""
    first, third = np.asarray(gait.multipliers)[[0, 2]]
    return {
        "period": float(gait.measures.period),
        "step_length": float(gait.measures.step_length),
        "pair": [float(first.real), abs(float(first.imag))],
        "third": float(third.real),
    }


def draw_rungs(options, apart, costs):
    left, right = new_figure(8.0, 4.2).subplots(1, 2)
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
    return options.save(left.figure, "ladder.png")


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
    figure.axes[0].set_ylabel("distance from the rigid gait (relative)")
    named = figure.axes[0].get_legend_handles_labels()
    figure.legend(*named, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle("Filled: below the rigid gait's; hollow: above it", fontsize=9)
    return options.save(figure, "rigid_limit.png")


def draw_kneed(options, distances):
    figure = new_figure(4.6 * len(distances), 4.2)
    axes = np.atleast_1d(figure.subplots(1, len(distances), sharey=True))
    for ax, (path, rows) in zip(axes, distances.items(), strict=True):
        factors = [row["factor"] for row in rows]
        looks = zip(KNEED_MEASURES.items(), COLOURS, MARKERS, strict=False)
        for (name, words), colour, marker in looks:
            values = [row[name] for row in rows]
            ax.plot(factors, values, marker, color=colour, linestyle="-", label=words)
        ax.set_xscale("log", base=2)
        ax.set(yscale="log", xlabel="factor of the stiffness, $s$")
        power = path.removeprefix("c with ").replace("(", "{").replace(")", "}")
        ax.set_title(f"$c$ grows as ${power}$", loc="left")
        ax.grid(color="#DDDDDD")
        legend_below(ax, columns=2)
    axes[0].set_ylabel("distance from the rigid gait")
    return options.save(figure, "kneed_limit.png")


if __name__ == "__main__":
    main()
