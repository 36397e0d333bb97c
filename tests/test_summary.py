"""Summaries, against the walks, batches and sizes that they tell of."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._summary import _memory


def _walk(ending, steps=5, dtype=jnp.float64):
    ending = jnp.asarray(ending)
    shape = (*ending.shape, steps)
    state = jb.State(*[jnp.zeros(shape, dtype)] * 8)
    counts = jnp.zeros(ending.shape, dtype=jnp.int64)
    return jb.Trajectory(jnp.zeros(shape, dtype), state, ending, counts, counts, None, engine="xla")


def test_a_walk_tells_how_it_ended_and_how_large_it_is():
    # Nine arrays of five numbers, the ending and two counts.
    size = 9 * 5 * 8 + 3 * 8
    said = f"Trajectory(walking, engine=xla, shape=(5,), dtype=float64, {size} B)"
    assert repr(_walk(int(jb.Ending.WALKING))) == str(_walk(0)) == said
    assert "dtype=float32" in repr(_walk(0, dtype=jnp.float32))


def test_a_batch_counts_its_outcomes():
    falls, walks = int(jb.Ending.FELL_FORWARD), int(jb.Ending.WALKING)
    said = repr(_walk([walks, falls, walks]))
    assert said.startswith("Trajectory(2 walking, 1 fell forward, engine=xla, shape=(3, 5)")
    assert repr(_walk(np.zeros(0, dtype=int))).startswith("Trajectory(nothing, ")


def test_what_is_traced_prints_as_well():
    said = []
    jax.jit(lambda code: said.append(repr(_walk(code))))(0)
    assert said[0].startswith("Trajectory(traced, engine=xla, shape=(5,), dtype=float64, ")


@pytest.mark.parametrize(
    ("size", "said"), [(0, "0 B"), (999, "999 B"), (1500, "1.5 kB"), (2.5e9, "2.5 GB")]
)
def test_memory_in_powers_of_a_thousand(size, said):
    assert _memory(size) == said
