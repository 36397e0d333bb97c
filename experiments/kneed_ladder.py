"""The ladder of a walker with knees: its gait as feet and stops stiffen, and the one on rigid feet.

Writes kneed_limit.png: how far the period, the step length and the leading multipliers of McGeer's
kneed walker are from those on rigid feet, over the factor by which its contacts are stiffer.
"""

import numpy as np
from _experiment import Options, experiment
from _mechanisms import kneed
from _pictures import COLOURS, MARKERS

import jaxbiped as jb
from jaxbiped.plot.style import legend_below, new_figure

PATHS = {"c with K": 1.0, "c with K^(3/2)": 1.5}
"""By which power of the factor the damping c grows; the stiffness K grows as the factor."""
TITLES = {"c with K": "$c$ grows as $K$", "c with K^(3/2)": "$c$ grows as $K^{3/2}$"}
DOUBLINGS, QUICK_DOUBLINGS = 8, 4
EVERY = 2
"""Doublings from one point of a path to the next."""
PLAIN = dict(parameters=(), radius_sensitivities=False)
MEASURES = ("period", "step_length", "pair", "third")
WORDS = {
    "period": "period",
    "step_length": "step length",
    "pair": "leading pair of multipliers",
    "third": "third multiplier",
}


@experiment
def main(options: Options):
    soft = jb.models.mcgeer(knees=True)
    rigid = jb.find_gait(jb.RigidScene(kneed(), soft.ground), **PLAIN)
    doublings = options.sized(DOUBLINGS, QUICK_DOUBLINGS)
    chosen = options.sized([*PATHS], [*PATHS][1:])
    paths = {name: stiffened(soft, PATHS[name], doublings) for name in chosen}
    numbers = {"rigid": numbers_of(rigid), "paths": paths}
    distances = {name: away(rows, numbers["rigid"]) for name, rows in paths.items()}
    picture = draw(options, distances)
    return numbers | {"distances": distances, "pictures": [picture]}


def numbers_of(gait):
    """Measures of a gait: of its leading pair of multipliers real and imaginary part."""
    first, third = np.asarray(gait.multipliers)[[0, 2]]
    return {
        "period": float(gait.measures.period),
        "step_length": float(gait.measures.step_length),
        "pair": [float(first.real), abs(float(first.imag))],
        "third": float(third.real),
    }


def stiffened(soft, power, doublings):
    """Gaits of one stiffness after another, each searched from the last one's state."""
    start = jb.models.MODELS["mcgeer-kneed"].starts["gait"]
    guess, rows = soft.state(**start), []
    values = {name: float(x) for name, x in jb.parameter_values(soft).items()}
    for factor in (2.0**k for k in range(0, doublings + 1, EVERY)):
        grown = {name: values[name] * factor for name in ("K", "stop.K")}
        grown |= {name: values[name] * factor**power for name in ("c", "stop.c")}
        gait = jb.find_gait(jb.with_parameters(soft, grown), guess, **PLAIN)
        if gait.outcome is not jb.gait.Search.FOUND:
            break
        guess = gait.measures.state
        rows.append({"factor": factor} | numbers_of(gait))
    return rows


def away(rows, rigid):
    """How far each gait of a path is from the rigid one: lengths and times relative to it."""
    scales = {name: np.linalg.norm(rigid[name]) for name in MEASURES[:2]}
    return [
        {"factor": row["factor"]}
        | {
            name: float(np.linalg.norm(np.subtract(row[name], rigid[name])) / scales.get(name, 1.0))
            for name in MEASURES
        }
        for row in rows
    ]


def draw(options, distances):
    figure = new_figure(4.6 * len(distances), 4.2)
    axes = np.atleast_1d(figure.subplots(1, len(distances), sharey=True))
    for ax, (path, rows) in zip(axes, distances.items(), strict=True):
        factors = [row["factor"] for row in rows]
        for name, colour, marker in zip(MEASURES, COLOURS, MARKERS, strict=False):
            values = [row[name] for row in rows]
            ax.plot(factors, values, marker, color=colour, linestyle="-", label=WORDS[name])
        ax.set_xscale("log", base=2)
        ax.set(yscale="log", xlabel="factor of the stiffness, $s$")
        ax.set_title(TITLES[path], loc="left")
        ax.grid(color="#DDDDDD")
        legend_below(ax, columns=2)
    axes[0].set_ylabel("distance from the rigid gait")
    return options.save(figure, "kneed_limit.png")


if __name__ == "__main__":
    main()
