"""Whether a gait is found wherever walking forwards settles on one, and whether it is that one.

Writes search_robustness.png. Every scene is searched by `find_gait` without a guess, and walked
forwards for 300 footsteps from rolling starts and from its neighbours' last states. A scene counts
as missed where walks settle on a cycle of one footstep and the search does not return it, with the
same period to 1e-6.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from _experiment import Options, by, experiment
from _scenes import rigid_seed
from _timing import timed
from matplotlib.ticker import NullFormatter

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

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
STARTS, FOOTSTEPS, LONG = 48, 60, 300
CYCLES = (1, 2, 3, 4, 6, 8)
"""Lengths [footsteps] of cycles that are told apart."""
_SETTLED = 1e-7
"""Relative change of the duration of a cycle from one to the next that counts as none."""
QUICK = {"slope": [0.01, 0.045, 0.08], "mu": [0.2, 2.0], "simplest": [0.004, 0.009]}
"""Values of the families that a quick version walks."""


class Settled(NamedTuple):
    """What the walks of a scene do in the long run.

    Attributes:
        cycle: footsteps in the cycle that the longest walk repeats; 0 where it repeats none, −1
            where no walk goes on.
        period: duration of that cycle [s], NaN where there is none.
        state: of the walk's last arrival, None where no walk goes on.
    """

    cycle: int
    period: float
    state: Any


class Family(NamedTuple):
    """Scenes in a row, each by the number that tells it apart, what it is and its unit."""

    number: str
    unit: str
    values: Any
    scene: Callable[[float], Any]
    log: bool = False


def _seeds(name, unit, values, *, log=True):
    return Family(name, unit, values, lambda value: jb.seed_scene(**{name: value}), log)


def _random(number):
    """The seed's scene with every parameter up to half as much more or less."""
    generator = np.random.default_rng(int(number))
    own = jb.parameter_values(jb.seed_scene())
    while True:
        factors = 1.0 + SPREAD * generator.uniform(-1.0, 1.0, len(BODY))
        values = {name: float(own[name]) * f for name, f in zip(BODY, factors, strict=True)}
        values["n"] = max(1.0, values["n"])
        if values["mu_kinetic"] <= values["mu_static"] and values["d"] < values["l"]:
            return jb.seed_scene(**values)


def _rough(mu):
    """Static and kinetic friction in the seed's ratio."""
    return jb.seed_scene(mu_static=mu, mu_kinetic=0.8 * mu)


THIRD = 10**0.5
FAMILIES = {
    "slope": _seeds("slope", "rad", [0.0097, *(np.arange(10, 98) * 1e-3)], log=False),
    "K": _seeds("K", "N/m$^n$", np.geomspace(1e4, 1e9, 20)),
    "c": _seeds("c", "N s/m$^2$", np.geomspace(1e5, 1e9, 20)),
    "n": _seeds("n", "1", np.linspace(1.0, 3.0, 9), log=False),
    "r": _seeds("r", "m", np.geomspace(0.02, 0.2, 10)),
    "J": _seeds("J", "kg m$^2$", np.geomspace(0.0096 / THIRD, 0.0096 * THIRD, 10)),
    "m": _seeds("m", "kg", np.geomspace(1.0 / THIRD, THIRD, 10)),
    "mu": Family("static friction", "1", np.geomspace(0.2, 2.0, 10), _rough, log=True),
    "random": Family("number", "–", np.arange(RANDOM) + 1.0, _random),
    "rigid": Family("slope", "rad", np.arange(5, 101, 5) * 1e-3, rigid_seed),
    "simplest": Family(
        "slope", "rad", [*(np.arange(5, 190, 5) * 1e-4), 0.0187, 0.0189], jb.models.garcia
    ),
    "compass": Family(
        "slope", "degrees", np.arange(1, 11) * 0.5, lambda x: jb.models.goswami(math.radians(x))
    ),
}


@experiment
def main(options: Options):
    chosen = options.sized({name: family.values for name, family in FAMILIES.items()}, QUICK)
    families = {name: FAMILIES[name]._replace(values=values) for name, values in chosen.items()}
    found = {name: results(name, family) for name, family in families.items()}
    draw(options, found, families)
    return found


def results(name, family):
    """The search and the walks of every scene, these also from their neighbours' last states."""
    scenes = [family.scene(value) for value in family.values]
    found = [searched(scene) for scene in scenes]
    walks = [Settled(-1, float("nan"), None)] * len(found)
    near = []
    # Up and down again, so that a walk may begin where either neighbour settled.
    order = [*range(len(found)), *reversed(range(len(found)))]
    for place, i in enumerate(order):
        if place < len(found) or walks[i].cycle < 0:
            walks[i] = settled(scenes[i], [] if name == "random" else near, seed=100 + i)
        if walks[i].state is not None:
            near.append(walks[i].state)
    columns = zip(family.values, scenes, found, walks, strict=True)
    return [result(float(value), scene, *each, walk) for value, scene, each, walk in columns]


def settled(scene, near, *, seed):
    """Where walks from rolling starts, and from states `near` by, settle."""
    starts = jb.gait.rolling_starts(scene, STARTS, spread=0.5, seed=seed)
    for i, state in enumerate(near[-4:]):
        starts = jax.tree.map(lambda leaf, own, i=i: leaf.at[1 + i].set(own), starts, state)
    times, states, counts = _walked(scene, starts, FOOTSTEPS, 1e-5)
    walking = np.flatnonzero(np.asarray(counts) >= FOOTSTEPS)
    if not len(walking):
        return Settled(-1, float("nan"), None)
    durations = np.diff(np.asarray(times)[walking, -9:], axis=1)
    # How far each is from repeating itself after one footstep, or after two, or four.
    open_ = [min(abs(row[-1] / row[-1 - k] - 1.0) for k in (1, 2, 4)) for row in durations]
    best = walking[int(np.argmin(open_))]
    start = jax.tree.map(lambda leaf: leaf[best][None], states)
    times, states, counts = _walked(scene, start, LONG, 3e-9)
    if int(counts[0]) < LONG:
        return Settled(-1, float("nan"), None)
    times, state = np.asarray(times)[0], jax.tree.map(lambda leaf: leaf[0], states)
    for cycle in CYCLES:
        last, before = times[-1] - times[-1 - cycle], times[-1 - cycle] - times[-1 - 2 * cycle]
        if abs(last / before - 1.0) < _SETTLED:
            return Settled(cycle, float(last), state)
    return Settled(0, float("nan"), state)


@eqx.filter_jit
def _walked(scene, starts, footsteps, rtol):
    """Times of the arrivals, the last state with leg 2 standing, and how many there were."""

    def walk(start):
        if isinstance(scene, jb.RigidScene):
            how = dict(footsteps=footsteps, rtol=1e-11, max_arrivals=footsteps)
            return jb.rigid_walk(scene, start, **how).arrivals
        how = dict(footsteps=footsteps + 1, save=jb.MidStance(), max_arrivals=footsteps)
        how |= dict(rtol=rtol, max_solver_steps=1_000_000, engine="lanes")
        return jb.simulate(scene, start, **how).arrivals

    def one(start):
        at = walk(start)
        last = jax.tree.map(lambda leaf: leaf[-1], at.state)
        if not isinstance(scene, jb.RigidScene):
            stands = jnp.abs(last.theta_1) < jnp.abs(last.theta_2)
            other = jb.dynamics.exchange_legs(scene, last)
            last = jax.tree.map(lambda a, b: jnp.where(stands, a, b), other, last)
        return at.t, last._replace(hip_x=0.0 * last.hip_x), at.total

    return jax.vmap(one)(starts)


def searched(scene, footsteps=1):
    """The gait from no guess, and how long its search took [s]."""
    how = dict(parameters=(), radius_sensitivities=False, footsteps=footsteps)
    return timed(lambda: jb.find_gait(scene, **how))[:2]


def result(value, scene, gait, seconds, walk):
    """What the search and the walks say of one scene."""
    if walk.cycle > 1:
        gait, seconds = searched(scene, walk.cycle)
    period, found = float(gait.measures.period), gait.outcome is jb.gait.Search.FOUND
    if walk.cycle >= 1:
        same = bool(gait.stable) and abs(period - walk.period) <= SAME * walk.cycle
        agrees = "agrees" if walk.cycle == 1 else "agrees, longer cycle"
        verdict = agrees if same else "missed"
    elif found:
        verdict = "stable, walks not seen" if gait.stable else "unstable, no walk settles"
    else:
        verdict = "none, no walk settles"
    return {
        "value": value,
        "verdict": verdict,
        "found_by": str(gait.found_by) if found else "",
        "period": period,
        "radius": float(gait.measures.spectral_radius),
        "others": len(gait.others),
        "cycle": walk.cycle,
        "walked": walk.period,
        "seconds": seconds,
        "said": jb.gait.explain_search(scene, gait),
    }


def draw(options, found, families):
    """Periods over each family's parameter, coloured as the verdicts are."""
    rows = -(-len(found) // 3)
    figure = new_figure(12.0, 0.8 + 2.9 * rows)
    grid = figure.subplots(rows, 3, squeeze=False)
    for axes, (name, family) in zip(grid.flat, families.items(), strict=True):
        for verdict, own in by("verdict", found[name]).items():
            colour, marker = MARKS[verdict]
            values = [row["value"] for row in own]
            if verdict != "none, no walk settles":
                periods = [row["period"] / max(1, row["cycle"]) for row in own]
                axes.plot(values, periods, marker, color=colour, ms=4)
                continue
            # A scene without a gait stands at the bottom.
            bottom = dict(transform=axes.get_xaxis_transform(), clip_on=False)
            (mark,) = axes.plot(values, [0.0] * len(own), marker, color=colour, ms=6, **bottom)
            mark.set_in_layout(False)
        if family.log:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
            values = family.values
            if values[-1] < 100.0 * values[0]:
                few = values[:: max(1, len(values) // 3)]
                axes.set_xticks(few, [f"{value:.2g}" for value in few])
        axes.set_title(TITLES.get(name, ""), fontsize=10)
        axes.set(xlabel=f"{family.number} ({family.unit})", ylabel="time per footstep (s)")
        axes.grid(alpha=0.3)
    handles = [
        plt.Line2D([], [], color=colour, marker=marker, ls="", label=verdict)
        for verdict, (colour, marker) in MARKS.items()
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return options.save(figure, "search_robustness.png")


if __name__ == "__main__":
    main()
