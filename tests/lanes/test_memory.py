"""Memory that is used again: only what nobody refers to any more."""

import gc

import numpy as np
import pytest

from jaxbiped.lanes._memory import Memory


def _address(array):
    return array.ctypes.data


def test_memory_that_nobody_uses_is_given_again():
    memory = Memory(most=1 << 20)
    first = memory.array((10, 100))
    first[:] = 1.0
    where = _address(first)
    del first
    # Not quite as large, but as nearly as sizes are told apart.
    assert _address(memory.array((10, 99))) == where


def test_memory_that_a_view_refers_to_is_not_given_again():
    memory = Memory(most=1 << 20)
    first = memory.array((10, 100))
    where, row = _address(first), first[3, 5:]
    del first
    gc.collect()
    row[:] = 7.0
    other = memory.array((10, 100))
    assert _address(other) != where
    other[:] = 0.0
    np.testing.assert_array_equal(row, np.full(95, 7.0))
    del row
    assert _address(memory.array((10, 100))) == where


def test_no_more_is_kept_than_allowed():
    memory = Memory(most=10_000)
    arrays = [memory.array((1000,)) for _ in range(3)]
    places = [_address(each) for each in arrays]
    owners = [each.base for each in arrays]
    del arrays
    while owners:
        owners.pop(0)
    # There is room for one of 8192 bytes: what came first.
    assert memory.kept == 8192
    again = memory.array((1000,))
    assert _address(again) == places[0]
    assert memory.kept == 0


@pytest.mark.parametrize("shape", [(0, 5), (1,), (3, 0), (7, 11, 13)])
def test_shapes(shape):
    array = Memory(most=0).array(shape)
    assert array.shape == shape
    assert array.dtype == np.float64
    array[...] = 2.0
    assert np.sum(array) == 2.0 * array.size
