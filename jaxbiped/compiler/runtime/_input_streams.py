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
    """Of `count` simulations that read rows of so many numbers, of none where these are 0.

    Raises:
        ValueError: another number of arrays, or one without rows or with rows of another length.
    """
    rows = [
        np.ascontiguousarray(each, dtype=np.float64) for each in ([] if stream is None else stream)
    ]
    wanted = count if numbers else 0
    if len(rows) != wanted:
        raise ValueError(f"stream has {len(rows)} arrays of rows: it must have {wanted}.")
    for each in rows:
        # Machine code reads the rows unchecked.
        if each.ndim != 2 or len(each) == 0 or each.shape[1] != numbers:
            raise ValueError(
                f"stream holds an array of shape {each.shape}: it must be (rows, {numbers}), "
                "with at least one row."
            )
    lengths = np.array([len(each) for each in rows], dtype=np.int64)
    starts = np.array([each.ctypes.data for each in rows], dtype=np.int64)
    if not backwards:
        return InputStreams(starts, lengths, numbers, rows)
    size = numbers * np.dtype(np.float64).itemsize
    return InputStreams(starts + (lengths - 1) * size, lengths, -numbers, rows)
