"""Map of the spectral radius over contact stiffness K and damping c, a gait at every point.

Writes radius_map.png: the radius, and the period. The sweep runs twice, the second time compiled.
"""

import resource
import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from matplotlib.axes import Axes

import jaxbiped as jb

SEED = {"K": 1e6, "c": 1e7}
UNITS = {"K": "N/m$^{1.5}$", "c": "N s/m$^2$"}
POINTS, QUICK_POINTS = 100, 8
FACTOR = 2.0
"""From the seed's value down and up."""
KINDS: dict[str, dict[str, Any]] = {
    "measures, multipliers": dict(parameters=(), radius_sensitivities=False),
    "and sensitivities to all parameters": dict(radius_sensitivities=False),
    "and the radius's to K and c": dict(parameters=("K", "c"), radius_sensitivities=True),
}


def main() -> None:
    options = parse(__doc__ or "")
    count = QUICK_POINTS if options.quick else POINTS
    over = {k: v * np.geomspace(1.0 / FACTOR, FACTOR, count) for k, v in SEED.items()}
    rows, swept = [], None
    for kind, settings in list(KINDS.items())[: 1 if options.quick else None]:
        first, _, _ = timed(over, settings)
        seconds, cpu, dataset = timed(over, settings)
        swept = dataset if swept is None else swept
        found = int((dataset.ending == int(jb.gait.Search.FOUND)).sum())
        row = {
            "kind": kind,
            "gaits": count**2,
            "found": found,
            "stable": int((dataset.spectral_radius < 1.0).sum()),
            "first_s": first,
            "then_s": seconds,
            "cpu_s": cpu,
        }
        rows.append(row)
    options.table(rows, kind="", gaits="d", found="d", first_s=".1f", then_s=".1f", cpu_s=".1f")
    assert swept is not None
    picture = draw(options, swept)
    radius = swept.spectral_radius.data
    options.finish(
        {
            "rows": rows,
            "K": over["K"].tolist(),
            "c": over["c"].tolist(),
            "least_radius": float(np.nanmin(radius)),
            "largest_radius": float(np.nanmax(radius)),
            "picture": picture,
        }
    )


def timed(over: dict[str, np.ndarray], settings: dict[str, Any]) -> tuple[float, float, Any]:
    """Seconds and CPU seconds of a sweep, and its dataset."""
    began, used = time.perf_counter(), cpu_seconds()
    dataset = jb.gait_sweep(jb.seed_scene(), over, **settings)
    return time.perf_counter() - began, cpu_seconds() - used, dataset


def cpu_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def draw(options: Options, swept: Any) -> str:
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
    panel(left, swept, "spectral_radius", "spectral radius ρ")
    panel(right, swept, "period", "period [s]")
    figure.suptitle("Gaits of the seed's walker on 0.02 rad; white cross: its own K and c")
    return options.save(figure, "radius_map.png")


def panel(axes: Axes, swept: Any, name: str, title: str) -> None:
    values = swept[name].transpose("c", "K").data
    image = axes.pcolormesh(swept.K.data, swept.c.data, values, shading="nearest")
    lines = axes.contour(swept.K.data, swept.c.data, values, 8, colors="k", linewidths=0.6)
    axes.clabel(lines, fontsize=7)
    axes.plot(SEED["K"], SEED["c"], "x", color="w", ms=8, mew=2)
    axes.set(xscale="log", yscale="log", title=title)
    axes.set_xlabel(f"K [{UNITS['K']}]")
    axes.set_ylabel(f"c [{UNITS['c']}]")
    axes.figure.colorbar(image, ax=axes, label=title)


if __name__ == "__main__":
    main()
