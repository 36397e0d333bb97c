"""Whether a gait is found wherever walking forwards settles on one, and whether it is that one.

Writes search_robustness.png. Every scene is searched by `find_gait` without a guess, and walked
forwards for 300 footsteps from rolling starts and from its neighbours' last states. A scene counts
as missed where walks settle on a cycle of one footstep and the search does not return it, with the
same period to 1e-6.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from _settled import Settled, settled
from matplotlib.ticker import NullFormatter

import jaxbiped as jb

SAME = 1e-6
"""Largest difference [s] of two periods of one gait."""
RANDOM, SPREAD = 200, 0.5
"""Random scenes, and by how much each of their parameters may differ from the seed's."""
BODY = ("m", "J", "l", "d", "r", "slope", "n", "K", "c", "mu_static", "mu_kinetic", "v0", "xi")
MARKS = {
    "agrees": ("#1b7837", "o"),
    "agrees, longer cycle": ("#7fbf7b", "s"),
    "stable, walks not seen": ("#762a83", "D"),
    "unstable, no walk settles": ("#2166ac", "^"),
    "none, no walk settles": ("#7f7f7f", "|"),
    "missed": ("#d6604d", "x"),
}
"""Verdicts, with their colours and markers."""
TITLES = {
    "random": "200 random scenes",
    "rigid": "the seed's walker on rigid feet",
    "simplest": "simplest walker",
    "compass": "compass gait",
}
AXES = {"mu": "static friction", "random": "number", "J": "moment of inertia J"} | dict.fromkeys(
    ("rigid", "simplest", "compass"), "slope"
)


class Family(NamedTuple):
    """Scenes in a row, each with the number that tells it apart."""

    unit: str
    values: np.ndarray
    scene: Callable[[float], Any]
    log: bool = False


class Result(NamedTuple):
    """What the search and the walks say of one scene."""

    value: float
    verdict: str
    found_by: str
    period: float
    radius: float
    others: int
    cycle: int
    walked: float
    seconds: float
    said: str


def families(quick: bool) -> dict[str, Family]:
    def seed(name: str) -> Callable[[float], Any]:
        return lambda value: jb.seed_scene(**{name: value})

    def grid(name: str, unit: str, low: float, high: float, count: int) -> Family:
        values = np.geomspace(low, high, 2 if quick else count)
        return Family(unit, values, seed(name), log=True)

    slopes = np.linspace(0.01, 0.08, 3) if quick else np.append(0.0097, np.arange(10, 98) * 1e-3)
    found = {
        "slope": Family("rad", slopes, seed("slope")),
        "K": grid("K", "N/m$^n$", 1e4, 1e9, 20),
        "c": grid("c", "N s/m$^2$", 1e5, 1e9, 20),
        "n": Family("1", np.linspace(1.0, 3.0, 2 if quick else 9), seed("n")),
        "r": grid("r", "m", 0.02, 0.2, 10),
        "J": grid("J", "kg m$^2$", 0.0096 / 10**0.5, 0.0096 * 10**0.5, 10),
        "m": grid("m", "kg", 10**-0.5, 10**0.5, 10),
        "mu": Family("1", np.geomspace(0.2, 2.0, 2 if quick else 10), _rough, log=True),
        "random": Family("–", np.arange(2 if quick else RANDOM) + 1.0, _random),
    }
    steep = np.linspace(0.02, 0.05, 2) if quick else np.arange(5, 101, 5) * 1e-3
    simplest = [0.004, 0.009] if quick else [*np.arange(5, 190, 5) * 1e-4, 0.0187, 0.0189]
    found["rigid"] = Family("rad", steep, _rigid_seed)
    found["simplest"] = Family("rad", np.asarray(simplest), _simplest)
    found["compass"] = Family("degrees", np.arange(1, 3 if quick else 11) * 0.5, _compass)
    return {name: found[name] for name in ("slope", "mu", "simplest")} if quick else found


def _rough(mu: float) -> jb.Scene:
    """Static and kinetic friction in the seed's ratio."""
    return jb.seed_scene(mu_static=mu, mu_kinetic=0.8 * mu)


def _random(number: float) -> jb.Scene:
    """The seed's scene with every parameter up to half as much more or less."""
    generator = np.random.default_rng(int(number))
    while True:
        own = jb.parameter_values(jb.seed_scene())
        factors = 1.0 + SPREAD * generator.uniform(-1.0, 1.0, len(BODY))
        values = {name: float(own[name]) * f for name, f in zip(BODY, factors, strict=True)}
        values["n"] = max(1.0, values["n"])
        if values["mu_kinetic"] <= values["mu_static"] and values["d"] < values["l"]:
            return jb.seed_scene(**values)


def _rigid_seed(slope: float) -> jb.RigidScene:
    return jb.RigidScene(walker=jb.seed_scene().walker, ground=jb.Ground(slope=slope))


def _simplest(slope: float) -> jb.RigidScene:
    walker = jb.Walker(m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0)
    return jb.RigidScene(walker=walker, ground=jb.Ground(slope=slope, g=1.0))


def _compass(degrees: float) -> jb.RigidScene:
    walker = jb.Walker(m=5.0, J=0.0, l=1.0, d=0.5, r=0.0, hip_mass=10.0)
    return jb.RigidScene(walker=walker, ground=jb.Ground(slope=float(np.deg2rad(degrees))))


def searched(scene: Any, period: int = 1) -> tuple[jb.Gait, float]:
    """The gait from no guess, and how long its search took [s]."""
    began = time.perf_counter()
    gait = jb.find_gait(scene, parameters=(), radius_sensitivities=False, footsteps=period)
    gait.measures.period.block_until_ready()
    return gait, time.perf_counter() - began


def results(name: str, family: Family) -> list[Result]:
    """The search and the walks of every scene, these also from their neighbours' last states."""
    found = [searched(family.scene(value)) for value in family.values]
    walks: list[Settled] = [Settled(-1, float("nan"), None)] * len(found)
    near: list[Any] = []
    # Up and down again, so that a walk may begin where either neighbour settled.
    order = [*range(len(found)), *reversed(range(len(found)))]
    for place, i in enumerate(order):
        if place < len(found) or walks[i].cycle < 0:
            alike = [] if name == "random" else near
            walks[i] = settled(family.scene(family.values[i]), alike, seed=100 + i)
        if walks[i].state is not None:
            near.append(walks[i].state)
    rows = zip(family.values, found, walks, strict=True)
    return [result(family, value, *each, walk) for value, each, walk in rows]


def result(family: Family, value: float, gait: jb.Gait, seconds: float, walk: Settled) -> Result:
    period, length = float(gait.measures.period), 1
    scene = family.scene(value)
    verdict = _verdict(gait, walk)
    if walk.cycle > 1:
        length = walk.cycle
        gait, seconds = searched(scene, length)
        period = float(gait.measures.period)
        agrees = bool(gait.stable) and abs(period - walk.period) <= SAME * length
        verdict = "agrees, longer cycle" if agrees else "missed"
    return Result(
        value=float(value),
        verdict=verdict,
        found_by=str(gait.found_by) if gait.outcome is jb.gait.Search.FOUND else "",
        period=period,
        radius=float(gait.measures.spectral_radius),
        others=len(gait.others),
        cycle=walk.cycle,
        walked=walk.period,
        seconds=seconds,
        said=jb.gait.explain_search(scene, gait),
    )


def _verdict(gait: jb.Gait, walk: Settled) -> str:
    if walk.cycle == 1:
        same = bool(gait.stable) and abs(float(gait.measures.period) - walk.period) <= SAME
        return "agrees" if same else "missed"
    if gait.outcome is not jb.gait.Search.FOUND:
        return "none, no walk settles"
    return "stable, walks not seen" if bool(gait.stable) else "unstable, no walk settles"


def picture(options: Options, found: dict[str, list[Result]], kinds: dict[str, Family]) -> None:
    """Periods over each family's parameter, coloured as the verdicts are."""
    rows = -(-len(found) // 3)
    size = (12.0, 0.8 + 2.9 * rows)
    figure, grid = plt.subplots(rows, 3, figsize=size, layout="constrained", squeeze=False)
    for axes, (name, results_) in zip(grid.flat, found.items(), strict=True):
        for verdict, (colour, marker) in MARKS.items():
            chosen = [row for row in results_ if row.verdict == verdict]
            values = [row.value for row in chosen]
            periods = [row.period / max(1, row.cycle) for row in chosen]
            if verdict != "none, no walk settles":
                axes.plot(values, periods, marker, color=colour, ms=4)
                continue
            # A scene without a gait stands at the bottom.
            bottom = dict(transform=axes.get_xaxis_transform(), clip_on=False)
            (mark,) = axes.plot(
                values, 0.0 * np.asarray(values), marker, color=colour, ms=6, **bottom
            )
            mark.set_in_layout(False)
        if kinds[name].log:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
            values = kinds[name].values
            if values[-1] < 100.0 * values[0]:
                few = values[:: max(1, len(values) // 3)]
                axes.set_xticks(few, [f"{value:.2g}" for value in few])
        axes.set_title(TITLES.get(name, ""), fontsize=10)
        axes.set_xlabel(f"{AXES.get(name, name)} [{kinds[name].unit}]")
        axes.set_ylabel("time per footstep [s]")
        axes.grid(alpha=0.3)
    handles = [
        plt.Line2D([], [], color=colour, marker=marker, ls="", label=verdict)
        for verdict, (colour, marker) in MARKS.items()
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    options.save(figure, "search_robustness.png")


def main() -> None:
    options = parse(__doc__ or "")
    began = time.perf_counter()
    kinds, found = families(options.quick), {}
    for name, family in kinds.items():
        rows = found[name] = results(name, family)
        counts = {v: sum(row.verdict == v for row in rows) for v in MARKS}
        counts = {v: count for v, count in counts.items() if count}
        slowest = max(row.seconds for row in rows[1:])
        options.say(f"{name:>9} ({len(rows):3d}): {counts}; slowest search {slowest:.2f} s")
        for row in rows:
            if row.verdict == "missed":
                options.say(
                    f"          {row.value:.6g}: walks {row.cycle} {row.walked:.7f}; {row.said}"
                )
    options.say(f"{time.perf_counter() - began:.0f} s")
    picture(options, found, kinds)
    options.finish({name: [row._asdict() for row in rows] for name, rows in found.items()})


if __name__ == "__main__":
    main()
