"""What simulations recorded waits on the host until somebody asks for it."""

import collections
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

Tables = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of n simulations: outputs (numbers, n), records (n, room, numbers), and how many these are."""


class _Entry(NamedTuple):
    outputs: np.ndarray
    records: np.ndarray

    @property
    def size(self) -> int:
        return self.outputs.nbytes + self.records.nbytes


class HeldBack:
    """What simulations gave, by program and inputs, as long as there is room for it.

    A search makes many turns and needs the records of two of them, known only at its end: they
    need not travel through it. Nothing depends on what is held: what is missing is run again.
    """

    def __init__(self, most: int) -> None:
        """Holds `most` bytes; beyond them what came first goes first."""
        self._most, self._size = most, 0
        self._entries: collections.OrderedDict[Any, _Entry] = collections.OrderedDict()
        self._lock = threading.Lock()

    def ran(self, program: Any, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]) -> Tables:
        """What `run` finds for inputs (numbers, n), which is then known."""
        found = outputs, records, counts = run(inputs)
        with self._lock:
            for i, column in enumerate(inputs.T):
                self._drop((program, column.tobytes()))
                entry = _Entry(outputs[:, i].copy(), records[i, : counts[i]].copy())
                self._entries[program, column.tobytes()] = entry
                self._size += entry.size
            while self._size > self._most:
                self._drop(next(iter(self._entries)))
        return found

    def outputs(
        self, program: Any, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]
    ) -> np.ndarray:
        """Outputs (numbers, n) for inputs (numbers, n); what is not known `run` finds."""
        return np.stack([entry.outputs for entry in self._known(program, inputs, run)], axis=1)

    def rows(
        self, program: Any, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]
    ) -> np.ndarray:
        """Records (n, longest, numbers), zeros beyond the last ones."""
        known = self._known(program, inputs, run)
        longest = max(1, *(len(entry.records) for entry in known))
        found = np.zeros((len(known), longest, known[0].records.shape[1]))
        for rows, entry in zip(found, known, strict=True):
            rows[: len(entry.records)] = entry.records
        return found

    def columns(
        self,
        program: Any,
        inputs: np.ndarray,
        first: np.ndarray,
        room: int,
        run: Callable[[np.ndarray], Tables],
    ) -> list[np.ndarray]:
        """Each number in a record as an array (n, 1 + room), NaN beyond the last record.

        Before those recorded comes that of `first`, shape (n, numbers).
        """
        known = self._known(program, inputs, run)
        found = [np.empty((len(known), 1 + room)) for _ in first.T]
        for i, entry in enumerate(known):
            for column, start, values in zip(found, first[i], entry.records.T, strict=True):
                column[i, 0], column[i, 1 : 1 + len(values)] = start, values
                column[i, 1 + len(values) :] = np.nan
        return found

    def _known(
        self, program: Any, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]
    ) -> list[_Entry]:
        keys = [(program, column.tobytes()) for column in inputs.T]
        with self._lock:
            known = {key: self._entries[key] for key in keys if key in self._entries}
        missing = [i for i, key in enumerate(keys) if key not in known]
        if missing:
            outputs, records, counts = self.ran(program, inputs[:, missing], run)
            for j, i in enumerate(missing):
                known[keys[i]] = _Entry(outputs[:, j], records[j, : counts[j]])
        return [known[key] for key in keys]

    def _drop(self, key: Any) -> None:
        entry = self._entries.pop(key, None)
        self._size -= 0 if entry is None else entry.size
