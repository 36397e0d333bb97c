"""Evaluations of designs: kept in memory and, where asked for, in a file to resume from.

A file has a line of JSON for each design. An optimiser that is run again asks for the same designs
in the same order, finds them here, and goes on where it was.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from jaxbiped._checks import ArgumentError
from jaxbiped._files import failure_kind, strict_json
from jaxbiped._identity import difference_of
from jaxbiped._types import JsonObject
from jaxbiped.optimise._objectives import Evaluation


class Evaluations:
    """Designs by their u, with what is known of each; None for one whose gait was lost."""

    def __init__(self, path: Path | None = None, settings: JsonObject | None = None) -> None:
        self._known: dict[bytes, Evaluation | None] = {}
        self._path, self.count = path, 0
        if path is None:
            return
        try:
            text = path.read_text() if path.exists() else ""
        except OSError as error:
            raise failure_kind(error)(f"store = {str(path)!r}: {error.strerror}.") from None
        except UnicodeDecodeError:
            text = "no text"
        if text:
            self._read(path, text.splitlines(), json.loads(strict_json(settings)))
        else:
            self._append(settings)
        if text and not text.endswith("\n"):
            self._append(None)  # what was cut off ends: the next line stands by itself

    def get(self, u: np.ndarray) -> Evaluation | None:
        """What is known of a design."""
        return self._known.get(u.tobytes())

    def is_lost(self, u: np.ndarray) -> bool:
        """Whether no gait was found there."""
        key = u.tobytes()
        return key in self._known and self._known[key] is None

    def add(self, u: np.ndarray, known: Evaluation | None) -> None:
        """Keeps a design, None for one that has no gait."""
        self._known[u.tobytes()] = known
        self.count += known is not None
        self._append({"u": u, "known": None if known is None else known._asdict()})

    def nearest(self, u: np.ndarray) -> tuple[np.ndarray, Evaluation]:
        """Of the designs with a gait the nearest one."""
        found = [(np.frombuffer(key), e) for key, e in self._known.items() if e is not None]
        return min(found, key=lambda each: float(np.linalg.norm(each[0] - u)))

    def _read(self, path: Path, lines: list[str], settings: JsonObject) -> None:
        rows = [_row(line) for line in lines]
        difference = "it holds something else"
        if isinstance(rows[0], dict):
            difference = difference_of(rows[0], settings) or ""
        if difference:
            raise ArgumentError(
                f"store = {str(path)!r} belongs to another problem ({difference}): give another "
                "file, or the same scene, variables, measures and settings."
            )
        for row in rows:
            # Two runs that begin one store both write what it is of.
            if isinstance(row, dict) and "u" in row:
                known = row["known"]
                u = np.asarray(row["u"], dtype=float)
                self._known[u.tobytes()] = None if known is None else _evaluation(known)
        self.count = sum(each is not None for each in self._known.values())

    def _append(self, row: JsonObject | None) -> None:
        """In one piece, so that another run may add to the same file; without a row a line's end.

        What is no finite number is a word that `float` reads.
        """
        if self._path is None:
            return
        text = "" if row is None else strict_json(row, unknown=str)
        try:
            with self._path.open("a") as file:
                file.write(text + "\n")
        except OSError as error:
            raise failure_kind(error)(f"store = {str(self._path)!r}: {error.strerror}.") from None


def _row(line: str) -> Any:
    """What a line holds, None where it was cut off."""
    try:
        return json.loads(line)
    except json.JSONDecodeError:
        return None


def _evaluation(told: JsonObject) -> Evaluation:
    for name in ("values", "errors"):
        told[name] = {key: float(value) for key, value in told[name].items()}
    for name in ("slopes", "slope_errors"):
        told[name] = {key: np.asarray(value, float) for key, value in told[name].items()}
    for name in ("state", "state_slopes"):
        told[name] = np.asarray(told[name], float)
    return Evaluation(**told | {"beyond_range": tuple(told["beyond_range"])})
