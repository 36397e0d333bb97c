"""Gaits over contact stiffness K, damping c and Stribeck rate ξ, a gait at every point.

Writes radius_map.png, spectral radius and period over K × c; that sweep runs twice, the second time
compiled. And elasticities.png, d log(measure) / d log(parameter) over two decades of each: 0.01
means that one per cent more of the parameter makes the measure 0.01 per cent larger.
"""

import numpy as np
from _experiment import Options, experiment
from _timing import timed

import jaxbiped as jb
from jaxbiped.plot.style import legend_below, new_figure

SEED = {"K": 1e6, "c": 1e7, "xi": 1e3}
POINTS, QUICK_POINTS = 100, 8
FACTOR = 2.0
"""From the seed's value down and up."""
KINDS = {
    "measures, multipliers": dict(parameters=(), radius_sensitivities=False),
    "and sensitivities to all parameters": dict(radius_sensitivities=False),
    "and the radius's to K and c": dict(parameters=("K", "c"), radius_sensitivities=True),
}
MEASURES = ("period", "step_length", "speed", "peak_normal", "spectral_radius")
ALONG, QUICK_ALONG = 17, 3
"""Gaits along each parameter, a decade to each side of the seed's value."""


@experiment
def main(options: Options):
    count = options.sized(POINTS, QUICK_POINTS)
    over = {k: SEED[k] * np.geomspace(1.0 / FACTOR, FACTOR, count) for k in ("K", "c")}
    rows, sweeps = [], []
    for kind in options.sized(list(KINDS), list(KINDS)[:1]):

        def sweep(kind=kind):
            return jb.gait_sweep(jb.seed_scene(), over, **KINDS[kind])

        _, first, _ = timed(sweep)
        found, seconds, cpu = timed(sweep)
        sweeps.append(found)
        row = {
            "kind": kind,
            "gaits": count**2,
            "found": int((found.ending == int(jb.gait.Search.FOUND)).sum()),
            "stable": int((found.spectral_radius < 1.0).sum()),
        }
        rows.append(row | {"first_s": first, "then_s": seconds, "cpu_s": cpu})
    radius = sweeps[0].spectral_radius.data
    measures = options.sized(MEASURES, MEASURES[:-1])
    lines = {name: along(name, options.sized(ALONG, QUICK_ALONG), measures) for name in SEED}
    return {
        "rows": rows,
        **{name: values.tolist() for name, values in over.items()},
        "least_radius": float(np.nanmin(radius)),
        "largest_radius": float(np.nanmax(radius)),
        "along": {
            name: {"value": own[name].data.tolist()} | {k: v.data.tolist() for k, v in own.items()}
            for name, own in lines.items()
        },
        "pictures": [draw_map(options, sweeps[0]), draw_lines(options, lines)],
    }


def along(name, count, measures):
    """Measures along a parameter, and their elasticities with respect to it with error bars."""
    values, radius = SEED[name] * np.logspace(-1.0, 1.0, count), "spectral_radius" in measures
    how = dict(parameters=(name,), radius_sensitivities=radius)
    found = jb.gait_sweep(jb.seed_scene(), {name: values}, **how).squeeze("parameter")
    told = (f"elasticity_{each}{end}" for each in measures for end in ("", "_error"))
    return found[["ending", *measures, *told]]


def draw_map(options, swept):
    left, right = new_figure(10.5, 4.4).subplots(1, 2)
    panel(left, swept, "spectral_radius", r"spectral radius, $\rho$ (–)")
    panel(right, swept, "period", "period, $T$ (s)")
    return options.save(left.figure, "radius_map.png")


def words_of(name):
    """Words, symbol and unit of a parameter."""
    return jb.parameter_quantities(jb.seed_scene())[name].on_axis()


def panel(axes, swept, name, words):
    values = swept[name].transpose("c", "K").data
    image = axes.pcolormesh(swept.K.data, swept.c.data, values, shading="nearest")
    lines = axes.contour(swept.K.data, swept.c.data, values, 8, colors="k", linewidths=0.6)
    for text in axes.clabel(lines, fontsize="small"):
        text.set_bbox(dict(facecolor="white", edgecolor="none", alpha=0.6, pad=0.5))
    axes.plot(SEED["K"], SEED["c"], "*", ms=14, mfc="w", mec="k", label="the seed's walker")
    axes.set(xscale="log", yscale="log", xlabel=words_of("K"), ylabel=words_of("c"))
    axes.grid(False)
    axes.figure.colorbar(image, ax=axes, label=words)
    legend_below(axes, columns=1)


def draw_lines(options, found):
    """A row for each measure, a column for each parameter; dotted: the seed's value."""
    measures = [name for name in MEASURES if name in found["K"]]
    grid = new_figure(10.5, 1.0 + 1.9 * len(measures)).subplots(len(measures), 3, sharex="col")
    for column, (name, swept) in zip(grid.T, found.items(), strict=True):
        for axes, key in zip(column, measures, strict=True):
            # The radius's jumps where another multiplier becomes the largest: no line there.
            form = "o" if key == "spectral_radius" else "o-"
            told = f"elasticity_{key}"
            points = swept[name], swept[told], swept[f"{told}_error"]
            axes.errorbar(*points, fmt=form, ms=3.5, capsize=2.0)
            axes.set_xscale("log")
            axes.axvline(SEED[name], color="#595959", linewidth=0.8, linestyle=":")
            axes.axhline(0.0, color="#595959", linewidth=0.8)
            axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
        axes.set_xlabel(words_of(name))
    for axes, key in zip(grid[:, 0], measures, strict=True):
        axes.set_ylabel(f"elasticity of\n{key.replace('_', ' ')} (–)")
    return options.save(grid[0, 0].figure, "elasticities.png")


if __name__ == "__main__":
    main()
