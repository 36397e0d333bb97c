"""An experiment: the options that each one takes, where its pictures and numbers go, its rows.

Numbers are printed as text: single ones in a list, rows that are alike in a table.
"""

import dataclasses
import functools
import json
import time
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import tyro
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxbiped.cli import Report
from jaxbiped.plot import figure_style, save_figure
from jaxbiped.plot.style import COLOURS, MARKERS

LOOK: dict[str, Any] = {
    "axes.prop_cycle": plt.cycler(color=COLOURS),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": "small",
    "axes.titlelocation": "left",
    "axes.titlesize": "medium",
}
"""Settings of matplotlib with which pictures made by hand look like those of `jaxbiped.plot`."""

MOST = 4
"""Numbers of a list that are printed; of a longer one it is said how many there are."""


class RowStore:
    """Rows by key, in the order in which they came: those that a file holds, and new ones.

    The file has a line of JSON for each, so that a run that was cut off goes on.

    Args:
        path: the file; None keeps nothing.
        writer: what rows depend on beside their keys: those of another writer do not count.
    """

    def __init__(self, path: Path | None, **writer: Any) -> None:
        self._path, self._writer = path, writer
        self.rows: dict[str, Any] = {}
        for line in path.read_text().splitlines() if path and path.exists() else ():
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:
                continue  # cut off while it was written
            if entry.get("writer") == writer:
                self.rows[entry["key"]] = entry["row"]

    def row(self, key: str, make: Callable[..., Any], *given: Any) -> Any:
        """The row of a key, made of what is given where there is none yet."""
        if key not in self.rows:
            self.rows[key] = make(*given)
            if self._path is not None:
                entry = {"key": key, "writer": self._writer, "row": self.rows[key]}
                with self._path.open("a") as lines:
                    lines.write(json.dumps(entry) + "\n")
        return self.rows[key]


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of an experiment."""

    out: Path = Path("out")
    """Folder for pictures and tables."""
    json: Path | None = None
    """File for the numbers in SI units; - prints only them."""
    quick: bool = False
    """A small version, in under a minute."""
    format: tuple[str, ...] = ("png",)
    """Formats of the pictures: png, pdf, svg."""
    style: str = "screen"
    """Style of the pictures: screen, or paper, with small letters and as wide as its columns."""
    columns: int = 1
    """Number of columns of a paper that a picture spans: 1 or 2."""

    def sized(self, full: Any, quick: Any) -> Any:
        """One of two sizes, as `quick` says."""
        return quick if self.quick else full

    def path(self, name: str) -> Path:
        """Where to write a file of this name."""
        self.out.mkdir(parents=True, exist_ok=True)
        return self.out / name

    def store(self, name: str, **writer: Any) -> RowStore:
        """Rows in a file of this name, those of the quick size apart."""
        return RowStore(self.path(f"{name}{'_quick' * self.quick}.jsonl"), **writer)

    def save(self, figure: Figure, name: str) -> str:
        """Writes a picture of this name and lets go of the figure; returns where it is."""
        dots = {"dpi": 150} if self.style == "screen" else {}
        paths = save_figure(figure, self.path(name), formats=self.format, **dots)
        plt.close(figure)
        return str(paths[0])


def experiment(measured: Callable[[Any], dict[str, Any]]) -> Callable[[], None]:
    """The command of a script: from its options to numbers, printed and written.

    Help is the script's docstring. Numbers are printed as tables, unless standard output belongs to
    the JSON, and written where `--json` says.
    """

    @functools.wraps(measured)
    def main() -> None:
        kind = typing.get_type_hints(measured)["options"]
        options = tyro.cli(kind, description=measured.__globals__["__doc__"])
        began, report = time.perf_counter(), Report(options.json)
        with figure_style(options.style, columns=options.columns), plt.rc_context(LOOK):
            numbers = measured(options)
        report.say(*tables(numbers), f"\nin {time.perf_counter() - began:.0f} s")
        report.finish(numbers)

    return main


def by(key: str, rows: Iterable[Mapping[str, Any]]) -> dict[Any, list[Any]]:
    """Rows by the value of an entry, in the order in which values come first."""
    found: dict[Any, list[Any]] = {}
    for row in rows:
        found.setdefault(row[key], []).append(row)
    return found


def draw_by(ax: Axes, key: str, rows: Iterable[Mapping[str, Any]], x: str, y: str) -> None:
    """A line for each value of an entry among rows, named after it: another entry over a third."""
    looks = zip(COLOURS, MARKERS, strict=True)
    for (name, own), (colour, marker) in zip(by(key, rows).items(), looks, strict=False):
        points = [row[x] for row in own], [row[y] for row in own]
        ax.plot(*points, marker=marker, color=colour, label=name)


def label(ax: Axes, x: str, y: str, title: str = "", *, log: str = "") -> None:
    """Words of axes, and their scales: "x", "y" or "xy" are logarithmic."""
    ax.set(xlabel=x, ylabel=y, title=title)
    if "x" in log:
        ax.set_xscale("log")
    if "y" in log:
        ax.set_yscale("log")


def tables(numbers: Any, title: str = "") -> Iterator[str]:
    """Lines that show numbers in mappings and lists; what is nested deeper follows below."""
    named = numbers if isinstance(numbers, Mapping) else dict(enumerate(numbers))
    nested = {name: each for name, each in named.items() if _is_nested(each)}
    plain = {name: each for name, each in named.items() if name not in nested}
    rows = [{"": name} | _plain(each) for name, each in nested.items()]
    if plain:
        yield from ("", title, *_aligned([[str(name), _cell(plain[name])] for name in plain]))
    elif all(len(row) > 1 for row in rows):
        heads = list(dict.fromkeys(head for row in rows for head in row))
        lines = [[_cell(row.get(head)) for head in heads] for row in rows]
        yield from ("", title, *_aligned([heads, *lines]))
        nested = {
            f"{name}, {key}": each
            for name, row in nested.items()
            for key, each in row.items()
            if _is_nested(each)
        }
    for name, each in nested.items():
        yield from tables(each, f"{title}, {name}" if title else str(name))


def _is_nested(value: Any) -> bool:
    """Whether it is a mapping, or a list that holds one."""
    inner = value if isinstance(value, list | tuple) else ()
    return isinstance(value, Mapping) or any(map(_is_nested, inner))


def _plain(value: Any) -> dict[str, Any]:
    """Entries of a row that go into one line."""
    pairs = value.items() if isinstance(value, Mapping) else ()
    return {name: each for name, each in pairs if not _is_nested(each)}


def _cell(value: Any) -> str:
    if isinstance(value, list | tuple):
        few = len(value) <= MOST and not any(isinstance(each, list | tuple) for each in value)
        return " ".join(map(_cell, value)) if few else f"{len(value)} entries"
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _aligned(lines: Sequence[Sequence[str]]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        yield "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
