"""Buffer pool: the first touch of a page takes longer than what is written there."""

import math
import weakref
from collections.abc import Callable

import numpy as np


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
