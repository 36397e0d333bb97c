"""Work and precision: what each way of solving costs for the error that it has.

Writes trade.png: errors of state, step times, energies, labels, gaits, multipliers and gradients
against CPU time and steps. Rows lie in trade.jsonl as they come: a run that was cut off goes on.
Ways that fail stay, in a band of their own.
"""

import dataclasses
from typing import Any

import _trade_basins
import _trade_batches
import _trade_gaits
import _trade_slopes
import _trade_walks
import tyro
from _options import Options
from _trade_pictures import draw
from _trade_store import Store
from tqdm import tqdm

from jaxbiped.trade import Row, cheapest, cost_at

CASES = (
    _trade_walks.cases,
    _trade_slopes.cases,
    _trade_gaits.cases,
    _trade_batches.cases,
    _trade_basins.cases,
    _trade_gaits.stepping_cases,
    _trade_gaits.cases_through_xla,
    _trade_walks.cases_through_xla,
)
ERRORS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""At which ways are compared, never at equal tolerance."""


@dataclasses.dataclass(frozen=True)
class TradeOptions(Options):
    """Options of the study."""

    stored: bool = False
    """Report what the store has, and measure nothing more."""


def main() -> None:
    options = tyro.cli(TradeOptions, description=__doc__)
    store = Store(options.path("trade_quick.jsonl" if options.quick else "trade.jsonl"))
    cases = [case for group in CASES for case in group(store, options.quick)]
    left = [] if options.stored else [case for case in cases if not store.measured(case)]
    for case in tqdm(left, unit="cases"):
        store.measure(case)
    rows = {group: store.rows(group) for group in dict.fromkeys(case.group for case in cases)}
    floors = {name: truth.floor for name, truth in store.truths().items()}
    compared = {group: comparison(found) for group, found in rows.items()}
    report(options, rows, floors, compared)
    numbers = rounded(
        {
            "floors": floors,
            "counts": {
                "cases": len(cases),
                "rows": sum(map(len, rows.values())),
                "failed": sum(row.outcome != "ok" for found in rows.values() for row in found),
            },
            "rows": {group: [row.numbers() for row in found] for group, found in rows.items()},
            "at_equal_error": compared,
        }
    )
    options.finish(numbers | {"picture": draw(options, rows, floors)})


def rounded(tree: Any) -> Any:
    """The same numbers to four digits, more than any of them is worth."""
    if isinstance(tree, dict):
        return {key: rounded(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [rounded(value) for value in tree]
    return float(f"{tree:.4g}") if isinstance(tree, float) else tree


def comparison(rows: list[Row]) -> dict[str, Any]:
    """By error axis: steps and CPU time of every way at equal errors, and the cheapest setting."""
    axes = dict.fromkeys(name for row in rows for name in row.errors)
    ways = dict.fromkeys(row.way for row in rows)
    table: dict[str, Any] = {}
    for axis in axes:
        mine = {way: [row for row in rows if row.way == way] for way in ways}
        table[axis] = {
            "steps": {way: at_errors(found, axis, "attempted") for way, found in mine.items()},
            "cpu_s": {way: at_errors(found, axis, "cpu_s") for way, found in mine.items()},
            "cheapest_by_cpu": [_best(rows, axis, error) for error in ERRORS],
        }
    return table


def at_errors(rows: list[Row], axis: str, cost: str) -> list[float | None]:
    """A way's cost at each of the errors, None where it does not reach them."""
    return [cost_at(rows, axis, error, lambda row: getattr(row, cost)) for error in ERRORS]


def _best(rows: list[Row], axis: str, error: float) -> list[str] | None:
    best = cheapest(rows, axis, error, lambda row: row.cpu_s)
    return None if best is None else [best.way, best.setting]


def report(
    options: Options,
    rows: dict[str, list[Row]],
    floors: dict[str, dict[str, float]],
    compared: dict[str, Any],
) -> None:
    for group, found in rows.items():
        options.say(f"\n{group}; the references disagree by {_told(floors.get(group, {}))}")
        for row in found:
            work = "" if row.cpu_s is None else f"{1e3 * row.cpu_s:10.2f} ms of CPU"
            steps = "" if row.attempted is None else f", {row.attempted} steps"
            options.say(
                f"  {row.way:42}{row.setting:12}{_told(row.errors)}{work}{steps}"
                + ("" if row.outcome == "ok" else f"  {row.outcome.upper()}")
            )
        for axis, table in compared[group].items():
            options.say(f"  CPU time [ms] at equal errors of {axis}")
            options.say(f"    {'':40}" + "".join(f"{error:>9.0e}" for error in ERRORS))
            for way, times in table["cpu_s"].items():
                cells = ["–" if t is None else f"{1e3 * t:.3g}" for t in times]
                options.say(f"    {way:40}" + "".join(f"{cell:>9}" for cell in cells))


def _told(errors: dict[str, float | None]) -> str:
    return ", ".join(f"{k} {'–' if v is None else f'{v:.1e}'}" for k, v in errors.items())


if __name__ == "__main__":
    main()
