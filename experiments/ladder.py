"""The ladder of fidelity: what each model of the walker costs, and what it changes.

Writes ladder.png, cost per footstep against the gait's distance from the rung above, and
rigid_limit.png, how the seed's gait approaches the rigid walker's as its contact stiffens.
"""

import os
from typing import Any

import numpy as np
from _options import Options, parse
from _rigid_limit import DOUBLINGS, PATHS, QUICK_DOUBLINGS, Approach, approach
from _rungs import Cost, cost_of, distances, gait_of, measures_of

import jaxbiped as jb
from jaxbiped.plot.style import new_figure

BATCH, QUICK_BATCH = 4096, 128
TOLERANCES = (1e-6, 1e-7, 1e-8)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000")
MARKERS = ("o", "s", "^", "D", "v")


def main() -> None:
    options = parse(__doc__ or "")
    quick = options.quick
    # One of each kind: the creeping rung compiles as long as the seed's, and is of its kind.
    rungs = {name: rung for name, rung in jb.ladder().items() if name != "creep" or not quick}
    gaits = {name: gait_of(scene) for name, scene in rungs.items()}
    measures = {name: measures_of(gait) for name, gait in gaits.items()}
    names = list(rungs)
    apart = {
        name: distances(measures[name], measures[above])
        for name, above in zip(names, [*names[1:], names[-1]], strict=True)
    }
    batch = QUICK_BATCH if quick else BATCH
    costs = costs_of(rungs, gaits, batch)
    say_rungs(options, measures, apart, costs)
    tolerances = TOLERANCES[:1] if quick else TOLERANCES
    pairs = [pair_of(rungs, gaits, batch, rtol, costs) for rtol in tolerances]
    say_pairs(options, pairs)
    doublings = QUICK_DOUBLINGS if quick else DOUBLINGS
    chosen = list(PATHS)[:2] if quick else list(PATHS)
    paths = {path: approach(path, gaits["rigid"], doublings) for path in chosen}
    say_paths(options, paths)
    pictures = [draw_rungs(options, apart, costs), draw_paths(options, paths)]
    options.finish(
        {
            "threads": os.cpu_count(),
            "measures": measures,
            "distance_from_rung_above": apart,
            "costs": {name: cost._asdict() for name, cost in costs.items()},
            "equal_errors": [
                {
                    "stribeck": a._asdict(),
                    "rigid": b._asdict(),
                    "batch_ratio": a.batch_us / b.batch_us,
                }
                for a, b in pairs
            ],
            "paths": {name: path._asdict() for name, path in paths.items()},
            "pictures": pictures,
        }
    )


def costs_of(rungs: dict[str, Any], gaits: dict[str, jb.Gait], batch: int) -> dict[str, Cost]:
    """Costs of all rungs; the rigid one's at no larger error than the seed's laws have."""
    costs = {
        name: cost_of(scene, gaits[name], batch) for name, scene in rungs.items() if name != "rigid"
    }
    error = costs["stribeck"].error
    return {"rigid": cost_of(rungs["rigid"], gaits["rigid"], batch, error=error)} | costs


def pair_of(
    rungs: dict[str, Any],
    gaits: dict[str, jb.Gait],
    batch: int,
    rtol: float,
    known: dict[str, Cost],
) -> tuple[Cost, Cost]:
    """Costs of the seed's laws at a tolerance, and of the rigid walker at no larger an error.

    What was measured of the rungs is not measured again.
    """
    if rtol == known["stribeck"].rtol:
        return known["stribeck"], known["rigid"]
    compliant = cost_of(rungs["stribeck"], gaits["stribeck"], batch, rtol=rtol)
    return compliant, cost_of(rungs["rigid"], gaits["rigid"], batch, error=compliant.error)


def say_pairs(options: Options, pairs: list[tuple[Cost, Cost]]) -> None:
    options.say()
    for compliant, rigid in pairs:
        options.say(
            f"at errors of {compliant.error:.1e} and {rigid.error:.1e}: a compliant footstep "
            f"{compliant.batch_us:.2f} us, a rigid one {rigid.batch_us:.3f} us in a batch: "
            f"{compliant.batch_us / rigid.batch_us:.0f} to 1"
        )


def say_rungs(
    options: Options,
    measures: dict[str, Any],
    apart: dict[str, dict[str, float]],
    costs: dict[str, Cost],
) -> None:
    options.table(
        ({"rung": name} | found for name, found in measures.items()),
        rung="", period=".5f", step_length=".5f", spectral_radius=".4f",
    )  # fmt: skip
    options.say("distance from the rung above")
    names = ("period", "step_length", "spectral_radius")
    rows = ({"rung": name} | off for name, off in apart.items())
    options.table(rows, rung="", **dict.fromkeys(names, ".1%"))
    options.say("cost of a footstep")
    rows = ({"rung": name} | cost._asdict() for name, cost in costs.items())
    options.table(rows, rung="", rtol=".0e", error=".1e", single_us=".1f", batch_us=".3f")


def say_paths(options: Options, paths: dict[str, Approach]) -> None:
    options.say()
    options.say("path            gaits to factor  period    length    radius   rates of the three")
    for name, path in paths.items():
        rates = ", ".join("none" if p is None else f"{p:.2f}" for p in path.rates.values())
        options.say(
            f"{name:<15} {path.factors[-1]:>15.0f}  {path.period[-1]:>8.1e}  "
            f"{path.step_length[-1]:>8.1e}  {path.spectral_radius[-1]:>8.1e}  {rates}"
            + ("" if path.ended is None else f" ({path.ended})")
        )


def draw_rungs(options: Options, apart: dict[str, dict[str, float]], costs: dict[str, Cost]) -> str:
    figure = new_figure(8.0, 4.2)
    left, right = figure.subplots(1, 2)
    names = list(costs)
    rows = np.arange(len(names))
    for key, colour, label in (
        ("single_us", COLOURS[0], "one walk"),
        ("batch_us", COLOURS[1], "in a batch"),
    ):
        values = [getattr(costs[name], key) for name in names]
        left.plot(values, rows, "o", color=colour, label=label)
    left.set_xscale("log")
    left.set_xlabel("time for a footstep (µs)")
    left.set_title("Cost by lanes", loc="left")
    shown = {"period": "period", "step_length": "step length", "spectral_radius": "radius"}
    for k, (key, label) in enumerate(shown.items()):
        values = [100.0 * abs(apart[name][key]) for name in names[:-1]]
        right.plot(values, rows[:-1], MARKERS[k], color=COLOURS[k], label=label)
    right.set_xscale("log")
    right.set_xlabel("distance from the rung above (%)")
    right.set_title("What the next rung changes", loc="left")
    for ax in (left, right):
        ax.set_yticks(rows, names)
        ax.set_ylim(-0.5, len(names) - 0.5)
        ax.grid(axis="x", color="#DDDDDD")
        ax.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.18),
            ncols=3,
            frameon=False,
            columnspacing=1.0,
            handletextpad=0.2,
        )
    return options.save(figure, "ladder.png")


def draw_paths(options: Options, paths: dict[str, Approach]) -> str:
    figure = new_figure(9.0, 4.2)
    titles = {"period": "period", "step_length": "step length", "spectral_radius": "radius"}
    for ax, (key, title) in zip(figure.subplots(1, 3), titles.items(), strict=True):
        for k, (name, path) in enumerate(paths.items()):
            gaps = np.asarray(getattr(path, key))
            ax.plot(path.factors, np.abs(gaps), color=COLOURS[k], linewidth=1.0, label=name)
            above = gaps > 0.0
            factors = np.asarray(path.factors)
            # Hollow where the compliant gait's measure is the larger one.
            for side, fill in ((above, "white"), (~above, COLOURS[k])):
                ax.plot(
                    factors[side],
                    np.abs(gaps[side]),
                    MARKERS[k],
                    color=COLOURS[k],
                    markerfacecolor=fill,
                    markersize=4,
                )
        ax.set_xscale("log", base=2)
        ax.set_yscale("log")
        ax.set_title(title, loc="left")
        ax.set_xlabel("factor of the path, $s$")
        ax.grid(color="#DDDDDD")
    figure.axes[0].set_ylabel("distance from the rigid gait, relative")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle("Filled: below the rigid gait's; hollow: above it", fontsize=9)
    return options.save(figure, "rigid_limit.png")


if __name__ == "__main__":
    main()
