"""`jaxbiped trade`: what accuracy costs for a scene, by our own ways of solving."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tqdm import tqdm

from jaxbiped._progress import stage
from jaxbiped._types import JsonObject
from jaxbiped.cli._report import Report, table
from jaxbiped.cli._walk_options import OutputOptions
from jaxbiped.cli.commands._trade import Trade
from jaxbiped.dynamics._state import State
from jaxbiped.scene._scene import Scene
from jaxbiped.solve._accuracy import ACCURACIES, precision_of, tolerances
from jaxbiped.trade import GaitTrade, Row, Truth, WalkTrade, Way, cheapest

_ERRORS = (1e-2, 1e-4, 1e-6, 1e-8)
_MOST_ROWS = 200
_WALK_AXES = ("state", "step_time", "energy")
_GAIT_AXES = ("period", "multiplier", "gradient")
_QUICK = (("rodas4p", "lanes"), ("rodas5p", "lanes"))
_FULL = (
    *_QUICK,
    ("rodas4", "lanes"),
    ("rodas3p", "lanes"),
    ("rodas4p", "xla"),
    ("rodas5p", "xla"),
    ("kvaerno5", "xla"),
)
_QUICK_GAITS = (("rodas4", "lanes"),)
_FULL_GAITS = (*_QUICK_GAITS, ("rodas5p", "lanes"), ("rodas4", "xla"))
_FULL_TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


def run(options: Trade) -> int:
    """Runs the command; returns the exit code."""
    scene = options.scene.scene()
    assert isinstance(scene, Scene)
    start = options.start.state(scene)
    assert isinstance(start, State)
    OutputOptions(out=options.out, json=options.json).check()
    walk, gait = WalkTrade(scene, start, options.duration, options.repeats), GaitTrade(scene, 1)
    report = Report(options.json)
    found = {"walk": _measure(options, walk, _FULL if options.full else _QUICK)}
    found["gait"] = _measure(options, gait, _FULL_GAITS if options.full else _QUICK_GAITS)
    for name, (rows, truth) in found.items():
        _say(report, name, rows, truth)
    numbers: JsonObject = {"duration_s": options.duration}
    numbers["rows"] = [
        {"of": name} | row.numbers() for name, (rows, _) in found.items() for row in rows
    ]
    numbers["floors"] = {
        name: truth.floor for name, (_, truth) in found.items() if truth is not None
    }
    numbers["cheapest"] = {name: _advice(rows) for name, (rows, _) in found.items()}
    if options.out is not None:
        for path in _write_pictures(found, options.out):
            report.say(f"wrote {path}")
    report.finish(numbers)
    return 0 if found["walk"][1] is not None else 1


def _measure(
    options: Trade, trade: WalkTrade | GaitTrade, methods: tuple[tuple[str, str], ...]
) -> tuple[list[Row], Truth | None]:
    """Rows of all ways, and the truth that they are told against; no rows without one."""
    name = "walk" if isinstance(trade, WalkTrade) else "gait"
    with stage(f"solving the {name} by the references"):
        truth = trade.truth()
    if truth is None:
        return [], None
    ways = [
        Way(solver, engine, setting, rtol)
        for solver, engine in methods
        for setting, rtol in _settings(options, name, trade.scene)
    ]
    return [trade.row(way, truth) for way in tqdm(ways, unit=f"{name}s")], truth


def _settings(options: Trade, name: str, scene: Any) -> Iterator[tuple[str, float]]:
    """What a user would write, and the relative tolerance that it stands for in this scene."""
    for accuracy in ACCURACIES:
        if name == "walk":
            yield accuracy, float(tolerances(accuracy, None, None, scene).rtol)
        else:
            yield accuracy, float(precision_of(accuracy, scene).rtol)
    for rtol in _FULL_TOLERANCES if options.full else ():
        yield f"rtol={rtol:g}", rtol


def _advice(rows: list[Row]) -> JsonObject:
    """By error axis and error: the cheapest setting seen that has it, by CPU time."""
    axes = dict.fromkeys(axis for row in rows for axis in row.errors)
    found: JsonObject = {}
    for axis in axes:
        best = (cheapest(rows, axis, error, lambda row: row.cpu_s) for error in _ERRORS)
        found[axis] = {
            f"{error:g}": None if row is None else {"way": row.way, "setting": row.setting}
            for error, row in zip(_ERRORS, best, strict=True)
        }
    return found


def _say(report: Report, name: str, rows: list[Row], truth: Truth | None) -> None:
    if truth is None:
        report.say(f"\n{name}: the references found none, so that nothing is told of it")
        return
    axes = _WALK_AXES if name == "walk" else _GAIT_AXES
    lines = [
        (
            row.way,
            row.setting,
            row.outcome,
            *(_told(row.errors.get(axis)) for axis in axes),
            "" if row.attempted is None else str(row.attempted),
            "" if row.seconds is None else f"{1e3 * row.seconds:.1f}",
            "" if row.compile_s is None else f"{row.compile_s:.1f}",
        )
        for row in rows
    ]
    head = (name, "setting", "outcome", *axes, "steps", "run ms", "compile s")
    report.say(table(head, lines, most=_MOST_ROWS))
    known = ", ".join(f"{axis} {_told(floor)}" for axis, floor in truth.floor.items())
    report.say(f"errors are relative; two references disagree by: {known}")
    for axis, best in _advice(rows).items():
        said = "; ".join(
            f"{error}: " + ("none" if row is None else f"{row['way']}, {row['setting']}")
            for error, row in best.items()
        )
        report.say(f"cheapest for an error of {axis} of {said}")
    report.say()


def _told(error: float | None) -> str:
    return "" if error is None else f"{error:.1e}"


def _write_pictures(found: dict[str, tuple[list[Row], Truth | None]], out: Path) -> Iterator[Path]:
    """A picture for each error axis."""
    from jaxbiped import plot

    for rows, truth in found.values():
        for axis in dict.fromkeys(axis for row in rows for axis in row.errors):
            assert truth is not None
            told = [row.numbers() for row in rows]
            figure = plot.work_precision(told, axis, cost="seconds", floor=truth.floor.get(axis))
            figure.axes[0].legend(fontsize="small", frameon=False)
            path = out / f"trade_{axis}.png"
            figure.savefig(path)
            yield path
