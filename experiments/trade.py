"""Work and precision: what each way of solving costs for the error that it has.

Writes trade.png: errors of state, step times, energies, labels, gaits, multipliers and gradients
against CPU time and steps. Rows lie in trade.jsonl as they come: a run that was cut off goes on.
Ways that fail stay, in a band of their own.
"""

import dataclasses
import operator

import _trade_basins
import _trade_gaits
import _trade_slopes
import _trade_walks
from _experiment import Options, by, experiment
from _trade_store import Store
from tqdm import tqdm

import jaxbiped as jb
from jaxbiped.plot.style import legend_right, new_figure, set_title
from jaxbiped.trade import cheapest, cost_at

CASES = (
    _trade_walks.cases,
    _trade_slopes.cases,
    _trade_gaits.cases,
    _trade_walks.batch_cases,
    _trade_basins.cases,
    _trade_gaits.stepping_cases,
    _trade_gaits.cases_through_xla,
    _trade_walks.cases_through_xla,
)
ERRORS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""At which ways are compared, never at equal tolerance."""
PANELS = (
    ("walk", "state", "cpu_s", "State after 2 s"),
    ("walk", "state", "attempted", "State after 2 s, steps"),
    ("walk", "step_time", "cpu_s", "Times of heel strikes"),
    ("walk", "energy", "cpu_s", "Energy ledger"),
    ("batch", "state", "cpu_s", "State, a batch"),
    ("basin", "labels", "cpu_s", "Wrong labels of 4096 starts"),
    ("basin", "walking", "cpu_s", "Wrong labels of 4096 starts: walking or not"),
    ("slopes", "slopes", "cpu_s", "State's derivatives with respect to K, c, ξ"),
    ("gait", "period", "cpu_s", "Gait's period"),
    ("gait", "multiplier", "cpu_s", "Largest multiplier"),
    ("gait", "gradient", "cpu_s", "Period's derivatives with respect to K, c, ξ"),
    ("stepping", "gradient", "attempted", "Derivative of the period, by choice of steps"),
    ("smoothed laws", "state", "attempted", "State after 2 s, smoothed laws"),
    ("v0 ten times wider", "state", "attempted", "State after 2 s, v0 ten times wider"),
    ("rigid gait", "multiplier", "cpu_s", "Largest multiplier, rigid walker"),
)
"""Group, error axis, cost and title of each panel."""
COLUMNS = 2


@dataclasses.dataclass(frozen=True)
class TradeOptions(Options):
    """Options of the study."""

    stored: bool = False
    """Report what the store has, and measure nothing more."""


@experiment
def main(options: TradeOptions):
    store = Store(options.path(options.sized("trade.jsonl", "trade_quick.jsonl")))
    cases = [case for group in CASES for case in group(store, options.quick)]
    left = [] if options.stored else [case for case in cases if not store.measured(case)]
    for case in tqdm(left, unit="cases"):
        store.measure(case)
    rows = {group: store.rows(group) for group in dict.fromkeys(case.group for case in cases)}
    floors = {name: truth.floor for name, truth in store.truths().items()}
    every = [row for found in rows.values() for row in found]
    numbers = {
        "floors": floors,
        "counts": {
            "cases": len(cases),
            "rows": len(every),
            "failed": sum(row.outcome != "ok" for row in every),
        },
        "rows": {group: [row.numbers() for row in found] for group, found in rows.items()},
        "at_equal_error": {group: comparison(found) for group, found in rows.items()},
    }
    told = rounded(numbers)
    return told | {"picture": draw(options, told)}


def rounded(tree):
    """The same numbers to four digits, more than any of them is worth."""
    if isinstance(tree, dict):
        return {key: rounded(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [rounded(value) for value in tree]
    return float(f"{tree:.4g}") if isinstance(tree, float) else tree


def comparison(rows):
    """By error axis: steps and CPU time of every way at `ERRORS`, and the cheapest setting.

    None where a way does not reach an error.
    """
    ways = by("way", ({"way": row.way, "row": row} for row in rows))

    def costs(axis, name):
        cost = operator.attrgetter(name)
        return {
            way: [cost_at([each["row"] for each in own], axis, error, cost) for error in ERRORS]
            for way, own in ways.items()
        }

    def best(axis, error):
        found = cheapest(rows, axis, error, operator.attrgetter("cpu_s"))
        return None if found is None else [found.way, found.setting]

    return {
        axis: {
            "steps": costs(axis, "attempted"),
            "cpu_s": costs(axis, "cpu_s"),
            "cheapest_by_cpu": [best(axis, error) for error in ERRORS],
        }
        for axis in dict.fromkeys(name for row in rows for name in row.errors)
    }


def draw(options, numbers):
    """The panels of the groups that have errors, from the study's written numbers."""
    rows, floors = numbers["rows"], numbers["floors"]

    def has_errors(group, axis):
        return any(
            row["outcome"] == "ok" and row["errors"].get(axis) for row in rows.get(group, ())
        )

    shown = [panel for panel in PANELS if has_errors(*panel[:2])]
    lines = -(-len(shown) // COLUMNS)
    figure = new_figure(14.0, 3.9 * lines)
    axes = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    for ax, (group, axis, cost, title) in zip(axes, shown, strict=False):
        floor = floors.get(group, {}).get(axis)
        jb.plot.work_precision(rows[group], axis, cost=cost, floor=floor, ax=ax)
        set_title(ax, title, panel=True)
        legend_right(ax)
    for ax in axes[len(shown) :]:
        ax.set_visible(False)
    return options.save(figure, "trade.png")


if __name__ == "__main__":
    main()
