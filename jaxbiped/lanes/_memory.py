"""Memory that is used again: the first touch of a page takes longer than what is written there."""

import math
import weakref
from collections import defaultdict

import numpy as np


class Memory:
    """Gives arrays, and takes their memory back when nobody refers to them or to views of them.

    Attributes:
        kept: bytes that wait to be used again.
    """

    def __init__(self, most: int) -> None:
        """Keeps at most about `most` bytes that nobody uses."""
        self.kept, self._most = 0, most
        self._free: defaultdict[int, list[np.ndarray]] = defaultdict(list)

    def array(self, shape: tuple[int, ...]) -> np.ndarray:
        """Of 64-bit floating-point numbers, whatever was there before."""
        size = math.prod(shape)
        # Sizes differ a little from call to call: rounded up, they meet again.
        unit = 1 << max(size.bit_length() - 3, 0)
        capacity = max(-(-size // unit), 1) * unit
        try:
            owner = self._free[capacity].pop()
            self.kept -= owner.nbytes
        except IndexError:
            owner = np.empty(capacity)
        # Views of an array refer to its owner: this one owns nothing, so they refer to it.
        whole = np.frombuffer(owner.data)
        weakref.finalize(whole, self._take_back, owner).atexit = False
        return whole[:size].reshape(shape)

    def _take_back(self, owner: np.ndarray) -> None:
        # Called wherever garbage is found, by any thread: nothing here may wait for a lock.
        if self.kept + owner.nbytes <= self._most:
            self.kept += owner.nbytes
            self._free[len(owner)].append(owner)
