"""`jaxbiped trade`: what accuracy costs for a scene, by our own ways of solving."""

import contextlib
import functools
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Any

import jaxbiped as jb
from jaxbiped._files import JsonObject
from jaxbiped._progress import stage
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, csv_of, table
from jaxbiped.cli._scene_options import SceneOptions, compliant_and_minimal
from jaxbiped.cli._start_options import StartOptions

if TYPE_CHECKING:
    from jaxbiped.trade import GaitTrade, Row, Truth, WalkTrade

_ERRORS = (1e-2, 1e-4, 1e-6, 1e-8)
_MOST_ROWS = 200
_AXES = {
    "walk": ("state", "step_time", "energy"),
    "gait": ("period", "multiplier", "gradient"),
}
_QUICK = {
    "walk": (("rodas4p", "lanes"), ("rodas5p", "lanes")),
    "gait": (("rodas4", "lanes"),),
}
_FURTHER = {
    "walk": (
        ("rodas4", "lanes"),
        ("rodas3p", "lanes"),
        ("rodas4p", "xla"),
        ("rodas5p", "xla"),
        ("kvaerno5", "xla"),
    ),
    "gait": (("rodas5p", "lanes"), ("rodas4", "xla")),
}
_FURTHER_TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


class Trade(options.Command):
    """Measure what each accuracy costs for a scene: errors of a walk and of the gait, by our own
    methods, engines and tolerances, each beside its steps and its time."""

    scene: Annotated[SceneOptions, compliant_and_minimal("measured")]
    start: StartOptions
    duration: Annotated[float, options.positive("s")] = 2.0
    """Simulated time of the walk [s]."""
    repeats: options.Count = 3
    """Number of warm runs, of which the median counts."""
    full: bool = False
    """Try every solver, both engines and a ladder of tolerances; takes many minutes."""
    output: options.OutputOptions

    def run(self) -> int:
        from jaxbiped.trade import GaitTrade, Row, Truth, WalkTrade

        scene = self.scene.scene()
        assert isinstance(scene, jb.Scene)
        start = self.start.start(scene, self.scene.walker)
        self.output.make_folder()
        report = Report(self.output.json, self.output.csv)
        trades: dict[str, Any] = {
            "walk": WalkTrade(scene, start, self.duration, self.repeats),
            "gait": GaitTrade(scene, 1),
        }
        results, complete = dict[str, tuple[list[Row], Truth | None]](), False
        with contextlib.suppress(KeyboardInterrupt):  # what is measured is reported
            for name, trade in trades.items():
                with stage(f"solving the {name} with the reference methods"):
                    truth = trade.truth()
                rows, _ = results[name] = [], truth
                try:
                    rows.extend(self._rows(name, trade, truth))
                finally:
                    _say(report, name, rows, truth)
            complete = True
        numbers: JsonObject = {
            "duration_s": self.duration,
            "rows": [{"of": name} | row.numbers() for name, (rows, _) in results.items()
                     for row in rows],
            "floors": {name: truth.floor for name, (_, truth) in results.items() if truth},
            "cheapest": {name: _advice(rows) for name, (rows, _) in results.items()},
        }  # fmt: skip
        report.finish(numbers, lambda: csv_of(numbers["rows"]))
        for rows, truth in results.values():
            report.wrote(self.output.draw(_figures(rows, truth)))
        if not complete:
            raise options.interrupted(f"{len(numbers['rows'])} settings are measured")
        return int(any(truth is None for _, truth in results.values()))

    def _rows(
        self, name: str, trade: "WalkTrade | GaitTrade", truth: "Truth | None"
    ) -> "Iterator[Row]":
        """Rows of all methods, as they are measured; there is none without a reference."""
        from jaxbiped.trade import Way

        ways = [
            Way(solver, engine, setting, rtol)
            for solver, engine in _QUICK[name] + (_FURTHER[name] if self.full else ())
            for setting, rtol in self._settings(name, trade.scene)
        ]
        if truth is None:
            return
        with stage(f"measuring the {name}", total=len(ways), unit="methods") as now:
            for way in ways:
                yield trade.row(way, truth)
                now.update()

    def _settings(self, name: str, scene: Any) -> Iterator[tuple[str, float]]:
        """What a user would write, and the relative tolerance that it stands for in this scene."""
        from jaxbiped.solve._accuracy import precision_of, tolerances

        for accuracy in jb.ACCURACIES:
            if name == "walk":
                yield accuracy, float(tolerances(accuracy, None, None, scene).rtol)
            else:
                yield accuracy, float(precision_of(accuracy, scene).rtol)
        for rtol in _FURTHER_TOLERANCES if self.full else ():
            yield f"rtol={rtol:g}", rtol


def _axes(rows: "list[Row]") -> dict[str, None]:
    return dict.fromkeys(axis for row in rows for axis in row.errors)


def _advice(rows: "list[Row]") -> JsonObject:
    """By error axis and error: the cheapest setting seen that has it, by CPU time."""
    from jaxbiped.trade import cheapest

    found: JsonObject = {axis: {} for axis in _axes(rows)}
    for axis, settings in found.items():
        for error in _ERRORS:
            row = cheapest(rows, axis, error, lambda row: row.cpu_s)
            setting = None if row is None else {"way": row.way, "setting": row.setting}
            settings[f"{error:g}"] = setting
    return found


def _say(report: Report, name: str, rows: "list[Row]", truth: "Truth | None") -> None:
    if truth is None:
        report.say(f"\n{name}: the references found none, so that nothing is told of it")
        return
    lines = [
        (
            row.way,
            row.setting,
            row.outcome,
            *(_known(row.errors.get(axis), ".1e") for axis in _AXES[name]),
            _known(row.attempted, "d"),
            _known(row.seconds and 1e3 * row.seconds, ".1f"),
            _known(row.compile_s, ".1f"),
        )
        for row in rows
    ]
    head = (name, "setting", "outcome", *_AXES[name], "steps", "run ms", "compile s")
    report.say(table(head, lines, most=_MOST_ROWS))
    known = ", ".join(f"{axis} {_known(floor, '.1e')}" for axis, floor in truth.floor.items())
    report.say(f"errors are relative; two references disagree by: {known}")
    for axis, best in _advice(rows).items():
        said = "; ".join(
            f"{error}: " + ("none" if row is None else f"{row['way']}, {row['setting']}")
            for error, row in best.items()
        )
        report.say(f"cheapest for an error of {axis} of {said}")
    report.say()


def _known(number: float | None, form: str) -> str:
    return "" if number is None else format(number, form)


def _figures(rows: "list[Row]", truth: "Truth | None") -> dict[str, Callable[[], Any]]:
    """What draws a figure for each error axis, by the names of their files."""
    told = [row.numbers() for row in rows]

    def draw(axis: str) -> Any:
        assert truth is not None
        return jb.plot.work_precision(told, axis, cost="seconds", floor=truth.floor.get(axis))

    return {f"trade_{axis}": functools.partial(draw, axis) for axis in _axes(rows)}
