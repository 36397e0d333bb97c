"""Accuracy of labels: how many a tight solve changes, and how many of them are in doubt.

Writes label_accuracy.png. Starts are drawn over the slice of basin_seed.py and over a slice of the
rigid walker's. References are ours at a tolerance finer than any accuracy's: of the compliant
walker by rodas5p, which gives no label, held against rodas4; of the rigid walker at 1e-13.
"""

import functools
import warnings
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _basin_slice import AXES, OMEGA, THETA, UNITS
from _options import Options, parse
from tqdm import tqdm

import jaxbiped as jb

SLOPE = 0.02
STARTS, QUICK_STARTS = 10_000, 400
DRAWS, QUICK_DRAWS = 3, 1
NAMED = {"draft": "draft", "balanced": "balanced", "tight": "tight"}
TOLERANCES = (3e-5, 1e-5, 1e-6, 1e-7, 1e-8)
WANTED = (1e-2, 1e-3, 1e-4)
QUICK_TOLERANCES, QUICK_WANTED = (3e-5, 1e-5), (1e-2,)
FINEST = {"compliant": 1e-10, "rigid": 1e-13}
MOST_STEPS = 1 << 19
SCENES = {"compliant": jb.seed_scene(slope=SLOPE), "rigid": jb.ladder()["rigid"]}
BOUNDS = {
    "compliant": {"omega_swing": OMEGA, "theta_swing": THETA},
    "rigid": {"omega_stance": (-2.5, 0.0), "theta_stance": (0.0, 0.5)},
}


def main() -> None:
    options = parse("Accuracy of labels over random starts.")
    count, draws = (QUICK_STARTS, QUICK_DRAWS) if options.quick else (STARTS, DRAWS)
    named, picture = of_names(options, SCENES["compliant"], count)
    by_number = {
        name: of_numbers(options, name, scene, count, draws) for name, scene in SCENES.items()
    }
    options.finish(
        {
            "starts": count,
            "draws": draws,
            "named": named,
            "by_number": by_number,
            "picture": picture,
        }
    )


def starts_of(name: str, scene: Any, count: int, seed: int) -> Any:
    return jb.starts.sample(scene, BOUNDS[name], count, method="uniform", seed=seed)


def swept(scene: Any, starts: Any, **how: Any) -> Any:
    """A sweep's dataset."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the table tells it
        return jb.sweep(labelling_of(scene.compliant, tuple(how.items())), starts)


@functools.cache  # gaits are found once, not in each draw
def labelling_of(compliant: bool, how: tuple[tuple[str, Any], ...]) -> Any:
    scene = SCENES["compliant" if compliant else "rigid"]
    return jb.labelling(scene, **dict(how))


def reference(name: str, scene: Any, starts: Any) -> np.ndarray:
    """Labels to compare with; pending where the reference itself ran out of steps."""
    how: dict[str, Any] = {"rtol": FINEST[name], "max_solver_steps": MOST_STEPS}
    codes = swept(scene, starts, solver="rodas5p", **how)["label"].values
    out = codes == int(jb.basins.Label.OUT_OF_STEPS)
    return np.where(out, int(jb.basins.Label.PENDING), codes)


def differ(codes: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Whether labels are other than the reference's, where that is known."""
    return (codes != exact) & (exact != int(jb.basins.Label.PENDING))


def either_walks(codes: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Whether either label is walking."""
    walking = int(jb.basins.Label.WALKING)
    return (codes == walking) | (exact == walking)


def of_names(options: Options, scene: Any, count: int) -> tuple[dict[str, Any], str]:
    """How many labels change between the named accuracies and a finer solve, and where."""
    starts = starts_of("compliant", scene, count, 0)
    exact = reference("compliant", scene, starts)
    finest: dict[str, Any] = {"rtol": FINEST["compliant"], "max_solver_steps": MOST_STEPS}
    again = swept(scene, starts, **finest)["label"].values
    ways: dict[str, dict[str, Any]] = {name: {"accuracy": name} for name in NAMED}
    ways |= {
        f"{solver} {rtol:g}": {"rtol": rtol, "solver": solver}
        for solver in ("rodas4", "rodas5p")
        for rtol in (QUICK_TOLERANCES if options.quick else TOLERANCES)
    }
    found = {
        name: swept(scene, starts, max_solver_steps=MOST_STEPS, **how)
        for name, how in tqdm(ways.items(), unit="ways")
    }
    rows = []
    for name, each in found.items():
        codes = each["label"].values
        rows.append(
            {
                "way": name,
                "changed": int(differ(codes, exact).sum()),
                "walking_changed": int((differ(codes, exact) & either_walks(codes, exact)).sum()),
                "attempted": float(each["attempted"].mean()),
            }
        )
        options.say(
            f"{name:<16} {rows[-1]['changed']:6d} changed, "
            f"{rows[-1]['walking_changed']} of them walking or not"
        )
    draft, tight = (found[name]["label"].values for name in ("draft", "tight"))
    between = {
        f"{a} and {b}": int((found[a]["label"].values != found[b]["label"].values).sum())
        for a, b in (("draft", "balanced"), ("draft", "tight"), ("balanced", "tight"))
    }
    unknown = int((exact == int(jb.basins.Label.PENDING)).sum())
    numbers = {
        "reference_unknown": unknown,
        "rows": rows,
        "between": between,
        "references_differ": int(differ(again, exact).sum()),
    }
    return numbers, draw(options, starts_at(found["draft"]), exact, draft != tight, rows, count)


def starts_at(found: Any) -> tuple[np.ndarray, np.ndarray]:
    return found["start_theta_swing"].values, found["start_omega_swing"].values


def of_numbers(
    options: Options, name: str, scene: Any, count: int, draws: int
) -> list[dict[str, Any]]:
    """Of each accuracy asked for by a number: what it says of its labels, and what is true."""
    wishes = QUICK_WANTED if options.quick else WANTED
    rows: dict[float, list[dict[str, Any]]] = {wanted: [] for wanted in wishes}
    for seed in tqdm(range(1, draws + 1), unit="draws"):
        starts = starts_of(name, scene, count, seed)
        exact = reference(name, scene, starts)
        for wanted in wishes:
            found = swept(scene, starts, accuracy=wanted)
            said = jb.basins.label_errors(found)
            flagged = found["doubt"].values == int(jb.basins.Doubt.REMAINS)
            wrong = int((differ(found["label"].values, exact) & ~flagged).sum())
            plain = swept(scene, starts, rtol=said.rtol)
            rows[wanted].append(
                said.numbers()
                | {
                    "truly_wrong": wrong,
                    "wrong_before": int(differ(plain["label"].values, exact).sum()),
                    "steps_ratio": float(found["attempted"].sum() / plain["attempted"].sum()),
                }
            )
    return [told(options, name, wanted, each, count) for wanted, each in rows.items()]


def told(
    options: Options, name: str, wanted: float, rows: list[dict[str, Any]], count: int
) -> dict[str, Any]:
    """All draws of one accuracy together."""
    total = {
        key: sum(row[key] for row in rows)
        for key in ("relabelled", "changed", "in_doubt", "truly_wrong", "wrong_before")
    }
    starts = count * len(rows)
    numbers = total | {
        "wanted": wanted,
        "rtol": [row["rtol"] for row in rows],
        "met": sum(row["met"] for row in rows),
        "draws": len(rows),
        "kept": sum(row["truly_wrong"] <= wanted * count for row in rows),
        "within_interval": sum(row["truly_wrong"] <= row["wrong_high"] * count for row in rows),
        "wrong_share": total["truly_wrong"] / starts,
        "estimated_share": float(np.mean([row["wrong"] for row in rows])),
        "steps_ratio": float(np.mean([row["steps_ratio"] for row in rows])),
    }
    options.say(
        f"{name} {wanted:g}: {total['relabelled']} of {starts} labelled anew, "
        f"{total['changed']} changed, {total['in_doubt']} in doubt, {total['truly_wrong']} wrong "
        f"({total['wrong_before']} before), estimated {numbers['estimated_share']:.1e}, true "
        f"{numbers['wrong_share']:.1e}; within the interval {numbers['within_interval']} of "
        f"{len(rows)}; steps {numbers['steps_ratio']:.2f} times"
    )
    return numbers


def draw(
    options: Options,
    places: Any,
    codes: np.ndarray,
    differ: np.ndarray,
    rows: list[dict[str, Any]],
    count: int,
) -> str:
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained")
    theta, omega = places
    for code in np.unique(codes):
        own, label = codes == code, jb.basins.Label(int(code))
        unknown = label is jb.basins.Label.PENDING
        said = "the reference ran out of steps" if unknown else str(label)
        left.plot(theta[own], omega[own], ".", markersize=6 if unknown else 1.5, label=said)
    left.plot(theta[differ], omega[differ], "kx", markersize=6, label="draft and tight differ")
    left.set_xlabel(f"{AXES[0]} [{UNITS[0]}]")
    left.set_ylabel(f"{AXES[1]} [{UNITS[1]}]")
    left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    for solver in ("rodas4", "rodas5p"):
        points = [
            (rtol, row["changed"] / count)
            for row in rows
            for rtol in TOLERANCES
            if row["way"] == f"{solver} {rtol:g}"
        ]
        x, y = np.array(points).T
        right.loglog(x, np.where(y > 0.0, y, np.nan), "o-", label=solver)
    right.axhline(1.0 / count, color="0.6", linewidth=0.8, label="one label")
    right.set_xlabel("relative tolerance")
    right.set_ylabel("share of labels that a finer solve changes")
    right.set_xlim(min(TOLERANCES), max(TOLERANCES))
    right.set_ylim(0.5 / count, None)
    right.legend()
    return options.save(figure, "label_accuracy.png")


if __name__ == "__main__":
    main()
