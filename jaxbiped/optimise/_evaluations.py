"""Evaluations of designs: kept in memory and, where asked for, in a file to resume from.

A file has a line of JSON for each design. An optimiser that is run again asks for the same designs
in the same order, finds them here, and goes on where it was.
"""

import json
from pathlib import Path

import numpy as np

from jaxbiped._checks import ArgumentError, failure_kind
from jaxbiped._types import JsonObject
from jaxbiped.optimise._objectives import Evaluation


class Evaluations:
    """Designs by their u, with what is known of each; None for one whose gait was lost."""

    def __init__(self, path: Path | None, settings: JsonObject) -> None:
        self._known: dict[bytes, Evaluation | None] = {}
        self._path, self.count = path, 0
        if path is None:
            return
        try:
            if path.exists() and path.stat().st_size:
                self._read(path, settings)
            else:
                path.write_text(json.dumps(settings) + "\n")
        except OSError as error:
            raise failure_kind(error)(f"store = {str(path)!r}: {error.strerror}.") from None

    def get(self, u: np.ndarray) -> Evaluation | None:
        """What is known of a design."""
        return self._known.get(u.tobytes())

    def is_lost(self, u: np.ndarray) -> bool:
        """Whether no gait was found there."""
        key = u.tobytes()
        return key in self._known and self._known[key] is None

    def add(self, u: np.ndarray, known: Evaluation) -> None:
        """Keeps a design."""
        self._known[u.tobytes()] = known
        self.count += 1
        self._write(u, known)

    def lose(self, u: np.ndarray) -> None:
        """Keeps that a design has no gait."""
        self._known[u.tobytes()] = None
        self._write(u, None)

    def nearest(self, u: np.ndarray) -> tuple[np.ndarray, Evaluation]:
        """Of the designs with a gait the nearest one."""
        return min(self.all(), key=lambda each: float(np.linalg.norm(each[0] - u)))

    def all(self) -> list[tuple[np.ndarray, Evaluation]]:
        """The designs with a gait, in the order they were evaluated."""
        return [(np.frombuffer(key), each) for key, each in self._known.items() if each is not None]

    def _read(self, path: Path, settings: JsonObject) -> None:
        first, *lines = path.read_text().splitlines()
        try:
            same = json.loads(first) == json.loads(json.dumps(settings))
        except json.JSONDecodeError:
            same = False
        if not same:
            raise ArgumentError(
                f"store = {str(path)!r} belongs to another problem: give another file, or the same "
                "scene, variables, objective and requirements."
            )
        for line in lines:
            try:
                row = json.loads(line)
            except json.JSONDecodeError:  # cut off where a run was killed
                break
            u = np.asarray(row["u"], dtype=float)
            self._known[u.tobytes()] = None if row["known"] is None else _evaluation(row["known"])
        self.count = sum(each is not None for each in self._known.values())
        # What was cut off goes, so that the next line stands by itself.
        kept = [
            json.dumps({"u": np.frombuffer(k).tolist(), "known": _plain(e)})
            for k, e in self._known.items()
        ]
        path.write_text("\n".join([first, *kept]) + "\n")

    def _write(self, u: np.ndarray, known: Evaluation | None) -> None:
        if self._path is None:
            return
        try:
            with self._path.open("a") as file:
                file.write(json.dumps({"u": u.tolist(), "known": _plain(known)}) + "\n")
        except OSError as error:
            raise failure_kind(error)(f"store = {str(self._path)!r}: {error.strerror}.") from None


def _plain(known: Evaluation | None) -> JsonObject | None:
    if known is None:
        return None
    told = known._asdict()
    for name in ("slopes", "slope_errors"):
        told[name] = {key: value.tolist() for key, value in told[name].items()}
    for name in ("state", "state_slopes"):
        told[name] = told[name].tolist()
    return told


def _evaluation(told: JsonObject) -> Evaluation:
    for name in ("slopes", "slope_errors"):
        told[name] = {key: np.asarray(value) for key, value in told[name].items()}
    for name in ("state", "state_slopes"):
        told[name] = np.asarray(told[name])
    return Evaluation(**told | {"beyond_range": tuple(told.get("beyond_range", ()))})
