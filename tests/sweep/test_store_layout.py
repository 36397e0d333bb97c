"""Chunks, against the starts: each once, and none larger than was asked for."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped.sweep._store import Layout

NAMES = ("theta_stance", "theta_swing", "omega_stance", "omega_swing")


def _grid(shape):
    axes = {name: np.linspace(0.0, 1.0, size) for name, size in zip(NAMES, shape, strict=False)}
    return jb.starts.grid(jb.seed_scene(), axes)


@given(st.lists(st.integers(1, 6), min_size=1, max_size=4), st.integers(1, 300))
@settings(max_examples=60, deadline=None)
def test_chunks_cover_every_start_once(shape, chunk):
    starts = _grid(shape)
    layout = Layout.of(starts, chunk)
    numbers = np.arange(starts.size).reshape(shape)
    seen = []
    sizes = layout.sizes
    assert len(sizes) == layout.chunks
    for i in range(layout.chunks):
        first, last = layout.numbers(i)
        assert sizes[i] == last - first <= chunk
        assert math.prod(layout.shape_of(i)) == last - first
        part = numbers[layout.region(i)]
        np.testing.assert_array_equal(part.ravel(), np.arange(first, last))
        # A chunk of the store's arrays is written by one chunk of the sweep alone.
        whole = zip(layout.region(i), layout.chunk_shape, strict=True)
        assert all(place.start % size == 0 for place, size in whole)
        seen += range(first, last)
    assert seen == list(range(starts.size))


def test_a_chunk_of_a_large_grid_is_small():
    starts = _grid((1000, 1000, 1000, 10))
    layout = Layout.of(starts, 16384)
    assert layout.chunk_shape == (1, 1, 1000, 10)
    first, last = layout.numbers(layout.chunks - 1)
    assert (last, last - first) == (10**10, 10**4)
