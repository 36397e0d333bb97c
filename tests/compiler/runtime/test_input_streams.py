"""Programs that read a stream, a row at each attempt, against the rows."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.compiler import host
from tests.compiler.one_shot import NUMBER, called, stepped, two_zeros


def _summing():
    """Σ weight (a + 2 b) over as many rows (a, b) as the inputs say."""

    def attempt(given, carried, row):
        weight, steps = given
        total, count = carried
        count = count + 1.0
        return (total + weight * (row[0] + 2.0 * row[1]), count), count >= steps

    return stepped(attempt, (NUMBER, NUMBER), start=two_zeros, stream=2)


@pytest.mark.parametrize("count", [1, 2, 3, 19])
def test_every_simulation_reads_its_own_rows(count):
    random = np.random.default_rng(count)
    stream = random.standard_normal((count, 7, 2))
    weight, steps = random.standard_normal(count), 1.0 + np.arange(count) % 7
    for width in (1, host().width):
        total, read = _summing().run((weight, steps), stream=stream, width=width).outputs
        rows = np.arange(7) < steps[:, None]
        expected = weight * np.sum((stream[..., 0] + 2.0 * stream[..., 1]) * rows, axis=1)
        np.testing.assert_allclose(total, expected, rtol=1e-12, atol=1e-14)
        np.testing.assert_array_equal(read, steps)


def test_streams_under_jit_and_vmap():
    program = _summing()
    streams = jnp.arange(24.0).reshape(4, 3, 2)

    def one(stream, weight):
        return called(program, (weight, jnp.asarray(3.0)), stream=stream)[0]

    together = jax.jit(jax.vmap(one, in_axes=(0, None)))(streams, jnp.asarray(2.0))
    np.testing.assert_array_equal(together, [one(stream, jnp.asarray(2.0)) for stream in streams])


@pytest.mark.parametrize(
    ("stream", "said"),
    [
        (np.ones((1, 3, 2)), "stream has 1 arrays of rows: it must have 2."),
        (None, "stream has 0 arrays of rows: it must have 2."),
        (np.ones((2, 3, 1)), r"stream holds an array of shape \(3, 1\): it must be \(rows, 2\)"),
        (np.ones((2, 0, 2)), r"shape \(0, 2\).* with at least one row"),
        (np.ones((2, 2)), r"shape \(2,\)"),
    ],
)
def test_a_stream_of_another_size_is_refused(stream, said):
    """By an error that `python -O` keeps: the machine code would read what is not there."""
    with pytest.raises(ValueError, match=said):
        _summing().run((np.ones(2), np.ones(2)), stream=stream)
