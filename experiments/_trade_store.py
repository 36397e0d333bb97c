"""Store of a trade study: rows and truths that were measured, so that a cut-off run goes on."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from _experiment import RowStore

from jaxbiped.trade import Row, Truth, failed_row, truth_of

TRUTH = "truth"


class Case(NamedTuple):
    """One way at one setting, to be measured in its group."""

    group: str
    way: str
    setting: str
    measure: Callable[[], Row]

    @property
    def key(self) -> str:
        """What the store knows it by."""
        return f"{self.group}: {self.way}, {self.setting}"


def not_installed(group: str, way: str) -> Case:
    """The row of a peer that is missing."""
    setting = "rtol=1e-6"
    return Case(group, way, setting, lambda: failed_row(way, setting, "not installed"))


class Store:
    """Rows and truths that were measured, in the order in which they came."""

    def __init__(self, path: Path) -> None:
        self._kept = RowStore(path)

    def measured(self, case: Case) -> bool:
        """Whether a case has its row."""
        return case.key in self._kept.rows

    def measure(self, case: Case) -> None:
        """Measures a case and keeps its row; what it raises is its outcome."""

        def row() -> dict[str, Any]:
            try:
                return case.measure().numbers()
            except (RuntimeError, ValueError, FloatingPointError) as error:
                said = f"raised {type(error).__name__}"
                return failed_row(case.way, case.setting, said).numbers()

        self._kept.row(case.key, row)

    def rows(self, group: str) -> list[Row]:
        """The rows of a group."""
        own = (row for key, row in self._kept.rows.items() if key.startswith(f"{group}: "))
        return [Row(**{name: row[name] for name in Row._fields}) for row in own]

    def truths(self) -> dict[str, Truth]:
        """The truths that were solved, by name."""
        found = {key.partition(": "): pair for key, pair in self._kept.rows.items()}
        return {name: _truth(pair) for (kind, _, name), pair in found.items() if kind == TRUTH}

    def truth(self, name: str, references: Callable[[], tuple[Any, Any]]) -> Truth:
        """A truth and its floor, from what two references give; solved once."""

        def pair() -> list[dict[str, Any]]:
            return [{k: np.asarray(v).tolist() for k, v in each.items()} for each in references()]

        return _truth(self._kept.row(f"{TRUTH}: {name}", pair))


def _truth(pair: list[dict[str, Any]]) -> Truth:
    return truth_of(*({name: np.asarray(v) for name, v in each.items()} for each in pair))
