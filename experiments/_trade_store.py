"""Store of a trade study: one line of JSON for each case, so that a cut-off run goes on."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxbiped.trade import Row, Truth, failed_row, truth_of


class Case(NamedTuple):
    """One way at one setting, to be measured in its group."""

    group: str
    way: str
    setting: str
    measure: Callable[[], Row]

    @property
    def key(self) -> tuple[str, str, str]:
        """What the store knows it by."""
        return self.group, self.way, self.setting


class Store:
    """Rows and truths that were measured, in the order in which they came."""

    def __init__(self, path: Path) -> None:
        self._path = path
        lines = path.read_text().splitlines() if path.exists() else []
        self._entries: list[dict[str, Any]] = [json.loads(line) for line in lines]

    def measured(self, case: Case) -> bool:
        """Whether a case has its row."""
        return any(
            entry.get("way") == case.way
            and entry["setting"] == case.setting
            and entry["group"] == case.group
            for entry in self._entries
            if "truth" not in entry
        )

    def measure(self, case: Case) -> dict[str, Any]:
        """Measures a case and keeps its row; what it raises is its outcome."""
        try:
            row = case.measure()
        except (RuntimeError, ValueError, FloatingPointError) as error:
            row = failed_row(case.way, case.setting, f"raised {type(error).__name__}")
        return self._add({"group": case.group} | row.numbers())

    def rows(self, group: str) -> list[Row]:
        """The rows of a group."""
        return [
            Row(**{name: entry[name] for name in Row._fields})
            for entry in self._entries
            if "truth" not in entry and entry["group"] == group
        ]

    def truths(self) -> dict[str, Truth]:
        """The truths that were solved, by name."""
        return {
            entry["truth"]: truth_of(*(_arrays(entry[k]) for k in ("first", "second")))
            for entry in self._entries
            if "truth" in entry
        }

    def truth(self, name: str, references: Callable[[], tuple[Any, Any]]) -> Truth:
        """A truth and its floor, from what two references give; solved once."""
        known = self.truths().get(name)
        if known is not None:
            return known
        first, second = references()
        self._add({"truth": name, "first": _lists(first), "second": _lists(second)})
        return truth_of(first, second)

    def _add(self, entry: dict[str, Any]) -> dict[str, Any]:
        self._entries.append(entry)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a") as file:
            file.write(json.dumps(entry) + "\n")
        return entry


def _arrays(values: dict[str, Any]) -> dict[str, np.ndarray]:
    return {name: np.asarray(value) for name, value in values.items()}


def _lists(values: dict[str, Any]) -> dict[str, Any]:
    return {name: np.asarray(value).tolist() for name, value in values.items()}
