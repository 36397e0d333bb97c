"""Record cache: what simulations recorded waits on the host until somebody asks for it.

Another program may read them. They lie in memory that is used again: the first touch of a page
takes longer than what is written there.
"""

import collections
import math
import threading
import weakref
from collections.abc import Callable, Hashable
from typing import TypeAlias

import numpy as np

BLOCK = 512
"""Simulations that record, or read records, at once: all together would take much memory."""


class BufferPool:
    """Gives arrays, and takes their memory back when nobody refers to them or to views of them."""

    def __init__(self, most: Callable[[], int]) -> None:
        """Keeps at most `most` bytes that nobody uses; what waits longest goes first."""
        self._most = most
        self._free: dict[int, np.ndarray] = {}

    @property
    def kept(self) -> int:
        """Bytes that wait to be used again."""
        return sum(owner.nbytes for owner in list(self._free.values()))

    def clear(self) -> None:
        """Keeps nothing of what nobody uses now."""
        for key in list(self._free):
            self._free.pop(key, None)

    def array(self, shape: tuple[int, ...]) -> np.ndarray:
        """Of 64-bit floating-point numbers, whatever was there before."""
        size = math.prod(shape)
        # Sizes differ a little from call to call: rounded up, they meet again.
        unit = 1 << max(size.bit_length() - 3, 0)
        capacity = max(-(-size // unit), 1) * unit
        fitting = [key for key, owner in list(self._free.items()) if len(owner) == capacity]
        taken = (self._free.pop(key, None) for key in reversed(fitting))
        owner = next((each for each in taken if each is not None), None)
        if owner is None:
            owner = np.empty(capacity)
        # Views of an array refer to its owner: this one owns nothing, so they refer to it.
        whole = np.frombuffer(owner.data)
        weakref.finalize(whole, self._take_back, owner).atexit = False
        return whole[:size].reshape(shape)

    def _take_back(self, owner: np.ndarray) -> None:
        # Called wherever garbage is found, by any thread: nothing here may wait for a lock.
        most = self._most()
        if owner.nbytes > most:
            return
        self._free[id(owner)] = owner
        for key in list(self._free):
            if self.kept <= most:
                return
            self._free.pop(key, None)


Tables: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of n simulations: outputs (numbers, n), records (n, room, numbers), and how many these are."""
_Key: TypeAlias = tuple[Hashable, bytes]
"""A program and the bytes of one simulation's inputs."""


class RecordCache:
    """What simulations recorded, by program and inputs, as long as there is room for it.

    A search runs many simulations and needs the records of two of them, known only at its end:
    they need not travel through it. Nothing depends on what is held: what is missing is run again.
    """

    def __init__(self, most: Callable[[], int]) -> None:
        """Holds `most` bytes, inputs included; beyond them what came first goes first."""
        self._most, self._size = most, 0
        self._records: collections.OrderedDict[_Key, np.ndarray] = collections.OrderedDict()
        self._lock = threading.Lock()

    @property
    def kept(self) -> int:
        """Bytes of what is held."""
        return self._size

    def clear(self) -> None:
        """Holds nothing any more."""
        with self._lock:
            self._records.clear()
            self._size = 0

    def run(
        self, program: Hashable, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Outputs of what `run` finds for inputs (numbers, n), and its records, now known."""
        every, found = [], []
        for first in range(0, inputs.shape[1], BLOCK):
            outputs, records, counts = run(inputs[:, first : first + BLOCK])
            every.append(outputs)
            # Where they fill most of their room, that stays; else it would be held for little.
            filled = 2 * np.sum(counts) >= records.shape[0] * records.shape[1]
            own = [each[:n] for each, n in zip(records, counts, strict=True)]
            found += own if filled else [each.copy() for each in own]
        with self._lock:
            for column, each in zip(inputs.T, found, strict=True):
                key = program, column.tobytes()
                self._drop(key)
                self._records[key] = each
                self._size += _bytes_of(key, each)
            most = self._most()
            while self._size > most:
                self._drop(next(iter(self._records)))
        return np.concatenate(every, axis=1), found

    def records(
        self, program: Hashable, inputs: np.ndarray, run: Callable[[np.ndarray], Tables]
    ) -> list[np.ndarray]:
        """Records of each simulation (records, numbers); those that are not known `run` finds."""
        keys = [(program, column.tobytes()) for column in inputs.T]
        with self._lock:
            known = {key: self._records[key] for key in keys if key in self._records}
        missing = [i for i, key in enumerate(keys) if key not in known]
        if missing:
            _, found = self.run(program, inputs[:, missing], run)
            known |= {keys[i]: each for i, each in zip(missing, found, strict=True)}
        return [known[key] for key in keys]

    def forget(self, program: Hashable, inputs: np.ndarray) -> None:
        """Holds the records of these no longer."""
        with self._lock:
            for column in inputs.T:
                self._drop((program, column.tobytes()))

    def _drop(self, key: _Key) -> None:
        records = self._records.pop(key, None)
        self._size -= 0 if records is None else _bytes_of(key, records)


def _bytes_of(key: _Key, records: np.ndarray) -> int:
    return len(key[1]) + records.nbytes
