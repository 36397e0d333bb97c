"""Accuracy of labels and of their fractions: what a tight solve changes, what intervals hold.

Writes label_accuracy.png: how many labels a tight solve changes, and how many of them are in doubt.
Starts are drawn over the slice of basin_seed.py and over a slice of the
rigid walker's. References are ours at a tolerance finer than any accuracy's: of the compliant
walker by rodas5p, which gives no label, held against rodas4; of the rigid walker at 1e-13.

Then how often intervals of fractions hold the fraction of all draws together: starts are drawn
again and again, independently, for which the intervals are made, and by sequences that spread more
evenly. These draws lie in label_accuracy.jsonl as they come: a run that was cut off goes on.
"""

import collections
import itertools

import numpy as np
from _batches import AXES, OMEGA, THETA, UNITS, WALKING, labelled, starts_of
from _experiment import Options, experiment, label
from _scenes import rigid_seed
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import label_colour, legend_below, new_figure

STARTS, QUICK_STARTS = 10_000, 400
DRAWS, QUICK_DRAWS = 3, 1
NAMES = ("draft", "balanced", "tight")
SOLVERS = ("rodas4", "rodas5p")
TOLERANCES = (3e-5, 1e-5, 1e-6, 1e-7, 1e-8)
WANTED = (1e-2, 1e-3, 1e-4)
FINEST = {"compliant": 1e-10, "rigid": 1e-13}
MOST_STEPS = 1 << 19
SCENES = {"compliant": jb.seed_scene(), "rigid": rigid_seed()}
BOUNDS = {
    "compliant": {"omega_swing": OMEGA, "theta_swing": THETA},
    "rigid": {"omega_stance": (-2.5, 0.0), "theta_stance": (0.0, 0.5)},
}
METHODS = ("uniform", "sobol")
SIZE = 300
"""Starts of a draw whose fractions are looked at."""
FRACTIONS, QUICK_FRACTIONS = 1000, 5
"""Draws of them."""
PENDING, OUT_OF_STEPS = int(jb.basins.Label.PENDING), int(jb.basins.Label.OUT_OF_STEPS)


@experiment
def main(options: Options):
    count, draws = options.sized(STARTS, QUICK_STARTS), options.sized(DRAWS, QUICK_DRAWS)
    named, picture = of_names(options, count)
    wishes = options.sized(WANTED, WANTED[:1])
    by_number = {name: of_numbers(name, wishes, count, draws) for name in SCENES}
    rows = options.store("label_accuracy", starts=SIZE)
    often = options.sized(FRACTIONS, QUICK_FRACTIONS)
    fractions = {
        name: {method: coverage(rows, name, method, often) for method in METHODS}
        for name in ("rigid", "compliant")
    }
    return {
        "starts": count,
        "draws": draws,
        "named": named,
        "by_number": by_number,
        "fractions": {"starts": SIZE, "draws": often} | fractions,
        "picture": picture,
    }


def drawn(name, count, seed):
    return jb.starts.sample(SCENES[name], BOUNDS[name], count, method="uniform", seed=seed)


def reference(name, starts, **how):
    """Labels to compare with; pending where the reference itself ran out of steps."""
    found = labelled(name, starts, rtol=FINEST[name], max_solver_steps=MOST_STEPS, **how)
    codes = found["label"].values
    return np.where(codes == OUT_OF_STEPS, PENDING, codes)


def differ(codes, exact):
    """Whether labels are other than the reference's, where that is known."""
    return (codes != exact) & (exact != PENDING)


def of_names(options, count):
    """How many labels change between the named accuracies and a finer solve, and where."""
    starts = drawn("compliant", count, 0)
    exact = reference("compliant", starts, solver="rodas5p")
    again = reference("compliant", starts)
    ways = {name: {"accuracy": name} for name in NAMES}
    tolerances = options.sized(TOLERANCES, TOLERANCES[:2])
    for solver, rtol in itertools.product(SOLVERS, tolerances):
        ways[f"{solver} {rtol:g}"] = {"rtol": rtol, "solver": solver}
    found, rows = {}, []
    for name, how in tqdm(ways.items(), unit="ways"):
        each = labelled("compliant", starts, max_solver_steps=MOST_STEPS, **how)
        found[name] = codes = each["label"].values
        changed, either = differ(codes, exact), (codes == WALKING) | (exact == WALKING)
        rows.append(
            {
                "way": name,
                "changed": int(changed.sum()),
                "walking_changed": int((changed & either).sum()),
                "attempted": float(each["attempted"].mean()),
            }
        )
    pairs = (("draft", "balanced"), ("draft", "tight"), ("balanced", "tight"))
    numbers = {
        "reference_unknown": int((exact == PENDING).sum()),
        "rows": rows,
        "between": {f"{a} and {b}": int((found[a] != found[b]).sum()) for a, b in pairs},
        "references_differ": int(differ(again, exact).sum()),
    }
    places = each["start_theta_swing"].values, each["start_omega_swing"].values
    return numbers, draw(options, places, exact, found["draft"] != found["tight"], rows, count)


def of_numbers(name, wishes, count, draws):
    """Of each accuracy asked for by a number: what it says of its labels, and what is true."""
    rows = {wanted: [] for wanted in wishes}
    for seed in tqdm(range(1, draws + 1), unit="draws"):
        starts = drawn(name, count, seed)
        exact = reference(name, starts, solver="rodas5p")
        for wanted in wishes:
            found = labelled(name, starts, accuracy=wanted)
            said = jb.basins.label_errors(found)
            sure = found["doubt"].values != int(jb.basins.Doubt.REMAINS)
            plain = labelled(name, starts, rtol=said.rtol)
            own = {
                "truly_wrong": int((differ(found["label"].values, exact) & sure).sum()),
                "wrong_before": int(differ(plain["label"].values, exact).sum()),
                "steps_ratio": float(found["attempted"].sum() / plain["attempted"].sum()),
            }
            rows[wanted].append(said.numbers() | own)
    return [together(wanted, each, count) for wanted, each in rows.items()]


def together(wanted, rows, count):
    """All draws of one accuracy."""
    summed = ("relabelled", "changed", "in_doubt", "truly_wrong", "wrong_before")
    total = {key: sum(row[key] for row in rows) for key in summed}
    return total | {
        "wanted": wanted,
        "rtol": [row["rtol"] for row in rows],
        "met": sum(row["met"] for row in rows),
        "draws": len(rows),
        "kept": sum(row["truly_wrong"] <= wanted * count for row in rows),
        "within_interval": sum(row["truly_wrong"] <= row["wrong_high"] * count for row in rows),
        "wrong_share": total["truly_wrong"] / (count * len(rows)),
        "estimated_share": float(np.mean([row["wrong"] for row in rows])),
        "steps_ratio": float(np.mean([row["steps_ratio"] for row in rows])),
    }


def coverage(rows, name, method, draws):
    """By label: its fraction in all draws, and in how many draws its interval holds that.

    `scatter`: of the fractions, as a share of what independent starts have.
    """

    def counts(seed):
        starts = starts_of(SCENES[name], SIZE, method=method, seed=seed)
        found = jb.basins.fractions(labelled(name, starts, look=False)["label"].values)
        return {name: fraction.count for name, fraction in found.items()}

    bar = tqdm(range(draws), unit="draws", desc=f"{name} {method}")
    counted = [rows.row(f"{name} {method} {k}", counts, k) for k in bar]
    told = {}
    for each, total in sum(map(collections.Counter, counted), collections.Counter()).items():
        truth = total / (draws * SIZE)
        own = np.array([one.get(each, 0) for one in counted])
        low, high = jb.basins.wilson_interval(own, SIZE)
        binomial = np.sqrt(truth * (1.0 - truth) / SIZE)
        told[each] = {
            "fraction": truth,
            "inside_95": float(np.mean((low <= truth) & (truth <= high))),
            "scatter": float(np.std(own / SIZE) / binomial),
        }
    return told


def draw(options, places, codes, changed, rows, count):
    left, right = new_figure(11.0, 4.6).subplots(1, 2)
    theta, omega = places
    for name in jb.basins.Label:
        own, unknown = codes == int(name), name == PENDING
        words = "the reference ran out of steps" if unknown else str(name)
        look = dict(color="black", markersize=6) if unknown else dict(color=label_colour(words))
        if own.any():
            left.plot(theta[own], omega[own], ".", **dict(markersize=2) | look, label=words)
    left.plot(theta[changed], omega[changed], "kx", markersize=6, label="draft and tight differ")
    label(left, *(f"{name} ({unit})" for name, unit in zip(AXES, UNITS, strict=True)))
    legend_below(left, columns=3)
    shares = {row["way"]: row["changed"] / count for row in rows}
    for solver, marker in zip(SOLVERS, "os", strict=True):
        x = np.array([rtol for rtol in TOLERANCES if f"{solver} {rtol:g}" in shares])
        y = np.array([shares[f"{solver} {rtol:g}"] for rtol in x])
        right.plot(x, np.where(y > 0.0, y, np.nan), f"{marker}-", label=solver)
    right.axhline(1.0 / count, color="0.6", linewidth=0.8, label="one label")
    words = "relative tolerance (–)", "share of labels that a finer solve changes (–)"
    label(right, *words, log="xy")
    right.set_ylim(bottom=0.5 / count)
    legend_below(right, columns=3)
    return options.save(left.figure, "label_accuracy.png")


if __name__ == "__main__":
    main()
