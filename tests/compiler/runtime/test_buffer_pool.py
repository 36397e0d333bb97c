"""Memory that is used again, against references: only what nobody refers to any more."""

import concurrent.futures
import gc

import numpy as np
import pytest

from jaxbiped.compiler.runtime._record_cache import BufferPool


def _address(array):
    return array.ctypes.data


def test_memory_that_nobody_uses_is_given_again():
    memory = BufferPool(lambda: 1 << 20)
    first = memory.array((10, 100))
    first[:] = 1.0
    where = _address(first)
    del first
    # Not quite as large, but as nearly as sizes are told apart.
    assert _address(memory.array((10, 99))) == where


def test_memory_that_a_view_refers_to_is_not_given_again():
    memory = BufferPool(lambda: 1 << 20)
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
    memory = BufferPool(lambda: 20_000)
    arrays = [memory.array((1000,)) for _ in range(3)]
    places = [_address(each) for each in arrays]
    while arrays:
        arrays.pop(0)
    # There is room for two of 8192 bytes: the last ones.
    assert memory.kept == 2 * 8192
    again = [memory.array((1000,)) for _ in range(2)]
    assert [_address(each) for each in again] == [places[2], places[1]]
    assert memory.kept == 0
    del again
    memory.array((10_000,))
    assert memory.kept == 2 * 8192


def test_other_sizes_make_room():
    memory = BufferPool(lambda: 20_000)
    for size in (100, 1000, 1500, 2000):
        array = memory.array((size,))
        where = _address(array)
        del array
        assert _address(memory.array((size,))) == where
        assert memory.kept <= 20_000


def test_threads_never_share_memory():
    memory = BufferPool(lambda: 1 << 20)

    def use(number):
        for _ in range(300):
            array = memory.array((50,))
            array[:] = number
            view = array[10:]
            del array
            if not np.all(view == number):
                return False
        return True

    with concurrent.futures.ThreadPoolExecutor(8) as threads:
        assert all(threads.map(use, range(8)))


@pytest.mark.parametrize("shape", [(0, 5), (1,), (3, 0), (7, 11, 13)])
def test_shapes(shape):
    array = BufferPool(lambda: 0).array(shape)
    assert array.shape == shape
    assert array.dtype == np.float64
    array[...] = 2.0
    assert np.sum(array) == 2.0 * array.size
