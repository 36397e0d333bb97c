"""Extremes: simulations, gaits and derivatives at the ends of every range, against a check.

Writes extremes.png, and beside it the verdicts, one case a line, from which a later run goes on.
The check are equations of motion written anew, solved by SciPy's LSODA at two tolerances, and at 40
digits where these leave too much doubt.
"""

import numpy as np
from _experiment import Options, by, experiment
from extreme_cases.catalogue import RANGES, catalogue
from extreme_cases.gaits import GaitJudge, gaits
from extreme_cases.grazing import grazing
from extreme_cases.verdict import VERDICTS, by_group, counts, judge, reasons, study
from matplotlib.ticker import MaxNLocator

from jaxbiped.plot.style import new_figure

COLOURS = ("#009E73", "#56B4E9", "#999999", "#D55E00", "#E69F00")
"""Of the verdicts."""
WITHIN = 1e-2
"""Relative error of a derivative at a graze from which it is wrong."""
WORDS = {
    "K": "contact stiffness, $K$ (N/m$^n$)", "c": "contact damping, $c$ (N s/m²)",
    "n": "contact exponent, $n$ (–)", "v0": "slip at the peak, $v_0$ (m/s)",
    "xi": r"decay of friction, $\xi$ (s/m)", "mu": r"static friction, $\mu_0$ (–)",
    "slope": r"slope, $\alpha$ (rad)", "hip mass": "hip mass, $m_S$ (kg)",
    "mass": "leg mass, $m$ (kg)", "inertia": "leg inertia (of the seed's)",
    "r": "foot radius, $r$ (m)", "d": "hip to mass centre, $d$ (m)",
    "size": "size (of the seed's)", "g": "gravity, $g$ (m/s²)",
}  # fmt: skip


@experiment
def main(options: Options):
    store = options.path("extremes.jsonl")
    cases = catalogue(quick=options.quick)
    rows = study(cases, judge, store=store)
    of_gaits = GaitJudge()
    found = study(list(gaits(quick=options.quick)), of_gaits, store=store, follow=of_gaits.follow)
    told = [row for row in rows if row["told"] is not None and row["verdict"] == "accurate"]
    errors = {
        name: [row[name] for row in found if row["multipliers"] is not None]
        for name in ("multipliers", "elasticities")
    }
    groups, by_value = _merged(by_group(rows, VERDICTS)), _by_value(rows)
    return {
        "catalogue": len(cases),
        **_counted(rows, groups),
        "precise": sum(row["precise"] for row in rows),
        "errors": {
            "told": len(told),
            "within_told": sum(row["error"] <= row["told"] for row in told),
            "most_beyond_told": max(row["error"] / max(row["told"], 1e-300) for row in told),
            "median_doubt": _median([row["doubt"] for row in rows if row["doubt"] is not None]),
        },
        "gaits": {
            **_counted(found, by_group(found, VERDICTS)),
            "compared": len(errors["multipliers"]),
            "median_error": {name: _median(each) for name, each in errors.items()},
            "largest_error": {name: max(each) for name, each in errors.items()},
        },
        "grazing": [_grazed(each) for each in grazing(**options.sized({}, dict(each=4, laws=1)))],
        "by_value": by_value,
        "picture": _draw(options, by_value),
    }


def _counted(rows, groups):
    told = {verdict: reasons(rows, verdict) for verdict in VERDICTS[1:]}
    return {**counts(rows, VERDICTS), "groups": groups, "reasons": told}


def _median(values):
    return float(np.median(values))


def _merged(groups):
    """The groups, all pairs of parameters as one."""
    merged = {}
    for name, counted in groups.items():
        pair = set(name.split(", ")) <= RANGES.keys() and ", " in name
        into = merged.setdefault("pairs" if pair else name, dict.fromkeys(counted, 0))
        for key, value in counted.items():
            into[key] += value
    return merged


def _grazed(swept):
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


def _by_value(rows):
    """Of each parameter: its values, each with the number of cases of each verdict."""
    told = {}
    for name in RANGES:
        own = [
            {"at": row["case"]["at"][name], "verdict": row["verdict"]}
            for row in rows
            if name in row["case"]["at"] and row["case"]["group"] != "laws"
        ]
        found = sorted(by("at", own).items())
        told[name] = [[at, *(counts(each, VERDICTS)[v] for v in VERDICTS)] for at, each in found]
    return told


def _draw(options, by_value):
    """Verdicts of the cases of one parameter by its value."""
    figure = new_figure(11.0, 8.5)
    *axes, _, last = figure.subplots(4, 4).ravel()
    for ax, (name, told) in zip(axes, by_value.items(), strict=True):
        values, *counted = zip(*told, strict=True)
        places, bottom = range(len(values)), np.zeros(len(values))
        for verdict, tall, colour in zip(VERDICTS, counted, COLOURS, strict=True):
            ax.bar(places, tall, 0.9, bottom, color=colour, label=verdict.replace("_", " "))
            bottom = bottom + tall
        shown = places[:: max(1, (len(values) + 2) // 3)]
        ax.set_xticks(shown, [_as_text(values[k]) for k in shown])
        ax.set(xlabel=WORDS[name], ylabel="cases")
        ax.grid(axis="x", visible=False)
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10], integer=True))
    for ax in figure.axes[len(axes) :]:
        ax.set_axis_off()
    last.legend(*axes[0].get_legend_handles_labels(), loc="center")
    return options.save(figure, "extremes.png")


def _as_text(value):
    """A value to two digits, with a power of ten where it has many zeros."""
    mantissa, power = f"{value:.1e}".split("e")
    if value == 0.0 or -3 <= int(power) <= 1:
        return f"{value:.2g}".replace("-", "−")
    digits = mantissa.removesuffix(".0")
    return f"$10^{{{int(power)}}}$" if digits == "1" else rf"${digits} \cdot 10^{{{int(power)}}}$"


if __name__ == "__main__":
    main()
