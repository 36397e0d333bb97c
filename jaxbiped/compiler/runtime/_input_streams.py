"""Input streams: where in memory the rows are that simulations read."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class InputStreams(NamedTuple):
    """Of n simulations.

    Attributes:
        starts: address of the row that each reads first, shape (n,).
        lengths: how many rows each has, shape (n,).
        stride: numbers from one row to the next.
        rows: what must stay in memory.
    """

    starts: np.ndarray
    lengths: np.ndarray
    stride: int
    rows: list[np.ndarray]


def input_streams_of(
    stream: Sequence[np.ndarray] | None, count: int, numbers: int, *, backwards: bool
) -> InputStreams:
    """Of `count` simulations that read rows of so many numbers, of none where these are 0."""
    rows = [
        np.ascontiguousarray(each, dtype=np.float64) for each in ([] if stream is None else stream)
    ]
    assert len(rows) == (count if numbers else 0)
    assert all(len(each) > 0 and each.shape[1] == numbers for each in rows)
    lengths = np.array([len(each) for each in rows], dtype=np.int64)
    starts = np.array([each.ctypes.data for each in rows], dtype=np.int64)
    if not backwards:
        return InputStreams(starts, lengths, numbers, rows)
    size = numbers * np.dtype(np.float64).itemsize
    return InputStreams(starts + (lengths - 1) * size, lengths, -numbers, rows)
