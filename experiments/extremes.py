"""Extremes: simulations, gaits and derivatives at the ends of every range, against a check.

Writes extremes.png, and beside it the verdicts, one case a line, from which a later run goes on.
The check are equations of motion written anew, solved by SciPy's LSODA at two tolerances, and at 40
digits where these leave too much doubt.
"""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _options import Options, parse
from extreme_cases.catalogue import RANGES, catalogue
from extreme_cases.gaits import GaitJudge, gaits
from extreme_cases.grazing import Grazing, grazing
from extreme_cases.store import by_group, counts, reasons, study
from extreme_cases.verdict import VERDICTS, judge

COLOURS = ("tab:green", "tab:blue", "tab:gray", "tab:red", "tab:orange")
WITHIN = 1e-2
"""Relative error of a derivative at a graze from which it is wrong."""


def main() -> None:
    options = parse("Simulations and gaits at the extremes, held against equations written anew.")
    store = options.path("extremes.jsonl")
    cases = catalogue(quick=options.quick)
    rows = study(cases, judge, store=store)
    of_gaits = GaitJudge()
    found = study(list(gaits(quick=options.quick)), of_gaits, store=store, follow=of_gaits.follow)
    compared = [row for row in found if row["multipliers"] is not None]
    told = [row for row in rows if row["told"] is not None and row["verdict"] == "accurate"]
    swept = grazing(each=4, laws=1) if options.quick else grazing()
    numbers = {
        "catalogue": len(cases),
        **counts(rows, VERDICTS),
        "precise": sum(row["precise"] for row in rows),
        "groups": _merged(by_group(rows, VERDICTS)),
        "reasons": {verdict: reasons(rows, verdict) for verdict in VERDICTS[1:]},
        "errors": {
            "told": len(told),
            "within_told": sum(row["error"] <= row["told"] for row in told),
            "most_beyond_told": max(row["error"] / max(row["told"], 1e-300) for row in told),
            "median_doubt": _median([row["doubt"] for row in rows]),
        },
        "gaits": {
            **counts(found, VERDICTS),
            "groups": by_group(found, VERDICTS),
            "reasons": {verdict: reasons(found, verdict) for verdict in VERDICTS[1:]},
            "compared": len(compared),
            "median_error": {
                name: _median([row[name] for row in compared])
                for name in ("multipliers", "elasticities")
            },
            "largest_error": {
                name: max(row[name] for row in compared) for name in ("multipliers", "elasticities")
            },
        },
        "grazing": [_grazed(each) for each in swept],
        "picture": _draw(options, rows),
    }
    for about in (numbers, numbers["gaits"]):
        options.say(", ".join(f"{name} {about[name]}" for name in ("run", *VERDICTS)))
    options.finish(numbers)


def _median(values: Sequence[float | None]) -> float:
    return float(np.median([value for value in values if value is not None]))


def _merged(groups: dict[str, dict[str, int]]) -> dict[str, dict[str, int]]:
    """The groups, all pairs of parameters as one."""
    merged: dict[str, dict[str, int]] = {}
    for name, counted in groups.items():
        first, _, second = name.partition(", ")
        pair = first in RANGES and second in RANGES
        into = merged.setdefault("pairs" if pair else name, dict.fromkeys(counted, 0))
        for key, value in counted.items():
            into[key] += value
    return merged


def _grazed(swept: Grazing) -> dict[str, Any]:
    """How derivatives about a graze compare with differences of the check."""
    accurate, flagged = swept.errors <= WITHIN, swept.flagged
    return {
        "law": swept.law,
        "accuracy": swept.accuracy,
        "derivatives": len(accurate),
        "accurate": int(np.sum(accurate)),
        "flagged": int(np.sum(flagged)),
        "silently_wrong": int(np.sum(~accurate & ~flagged)),
        "farthest_flagged_m": float(np.max(np.abs(swept.heights[flagged]), initial=0.0)),
        "largest_accurate": float(np.max(swept.errors[accurate], initial=0.0)),
    }


def _draw(options: Options, rows: list[dict[str, Any]]) -> str:
    """Verdicts of the cases of one parameter by its value."""
    names = list(RANGES)
    figure, axes = plt.subplots(4, 4, figsize=(11.0, 8.5), layout="constrained")
    for ax, name in zip(axes.flat, names, strict=False):
        own = [row for row in rows if name in row["case"]["at"] and row["case"]["group"] != "laws"]
        values = sorted({row["case"]["at"][name] for row in own})
        bottom = np.zeros(len(values))
        for verdict, colour in zip(VERDICTS, COLOURS, strict=True):
            height = np.array(
                [
                    sum(r["case"]["at"][name] == v and r["verdict"] == verdict for r in own)
                    for v in values
                ]
            )
            ax.bar(range(len(values)), height, 1.0, bottom, color=colour, label=verdict)
            bottom = bottom + height
        shown = range(0, len(values), max(1, (len(values) + 2) // 3))
        ax.set_xticks(list(shown), [f"{values[k]:.2g}" for k in shown])
        ax.set_xlabel(f"{name} {UNITS[name]}")
        ax.set_ylabel("cases")
    for ax in axes.flat[len(names) :]:
        ax.set_axis_off()
    handles, labels = axes.flat[0].get_legend_handles_labels()
    axes.flat[-1].legend(handles, [label.replace("_", " ") for label in labels], loc="center")
    return options.save(figure, "extremes.png")


UNITS = {
    "K": "[N/mⁿ]",
    "c": "[N s/m²]",
    "n": "[–]",
    "v0": "[m/s]",
    "xi": "[s/m]",
    "mu": "[–]",
    "slope": "[rad]",
    "hip mass": "[kg]",
    "mass": "[kg]",
    "inertia": "[of the seed's]",
    "r": "[m]",
    "d": "[m]",
    "size": "[of the seed's]",
    "g": "[m/s²]",
}

if __name__ == "__main__":
    main()
