"""An experiment: the options that each one takes, and where its pictures and numbers go."""

import dataclasses
import functools
import time
import typing
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import tyro
from _tables import tables
from matplotlib.figure import Figure

from jaxbiped.cli import Report
from jaxbiped.plot import figure_style, save_figure


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
        with figure_style(options.style, columns=options.columns):
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
