"""Map of the spectral radius over contact stiffness K and damping c, a gait at every point.

Writes radius_map.png: the radius, and the period. The sweep runs twice, the second time compiled.
"""

import numpy as np
from _experiment import Options, experiment
from _timing import timed

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

SEED = {"K": 1e6, "c": 1e7}
POINTS, QUICK_POINTS = 100, 8
FACTOR = 2.0
"""From the seed's value down and up."""
KINDS = {
    "measures, multipliers": dict(parameters=(), radius_sensitivities=False),
    "and sensitivities to all parameters": dict(radius_sensitivities=False),
    "and the radius's to K and c": dict(parameters=("K", "c"), radius_sensitivities=True),
}


@experiment
def main(options: Options):
    count = options.sized(POINTS, QUICK_POINTS)
    over = {k: v * np.geomspace(1.0 / FACTOR, FACTOR, count) for k, v in SEED.items()}
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
    return {
        "rows": rows,
        **{name: values.tolist() for name, values in over.items()},
        "least_radius": float(np.nanmin(radius)),
        "largest_radius": float(np.nanmax(radius)),
        "picture": draw(options, sweeps[0]),
    }


def draw(options, swept):
    figure = new_figure(10.5, 4.4)
    left, right = figure.subplots(1, 2)
    panel(left, swept, "spectral_radius", "spectral radius ρ")
    panel(right, swept, "period", "period [s]")
    figure.suptitle("Gaits of the seed's walker on 0.02 rad; white cross: its own K and c")
    return options.save(figure, "radius_map.png")


def panel(axes, swept, name, title):
    values = swept[name].transpose("c", "K").data
    image = axes.pcolormesh(swept.K.data, swept.c.data, values, shading="nearest")
    lines = axes.contour(swept.K.data, swept.c.data, values, 8, colors="k", linewidths=0.6)
    axes.clabel(lines, fontsize=7)
    axes.plot(SEED["K"], SEED["c"], "x", color="w", ms=8, mew=2)
    axes.set(xscale="log", yscale="log", title=title)
    axes.set(xlabel="K [N/m$^{1.5}$]", ylabel="c [N s/m$^2$]")
    axes.figure.colorbar(image, ax=axes, label=title)


if __name__ == "__main__":
    main()
