"""The precision of a start, against that of its solve."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.simulate._start import start_for

SEED = jb.seed_scene()
WIDTHS = {
    "NumPy scalars": np.float32,
    "NumPy arrays": lambda x: np.asarray(x, dtype=np.float32),
    "JAX arrays": lambda x: jnp.asarray(x, dtype=jnp.float32),
}


@pytest.mark.parametrize("kind", WIDTHS)
def test_a_start_in_float32_stays_so(kind):
    start, _ = start_for(SEED, jb.State(*[WIDTHS[kind](float(x)) for x in jb.seed_state()]))
    assert {leaf.dtype for leaf in start} == {np.dtype("float32")}


@pytest.mark.slow
def test_a_simulation_from_numpy_s_float32_is_solved_in_it():
    start = jb.State(*[np.float32(x) for x in jb.seed_state()])
    walk = jb.simulate(SEED, start, duration=0.05, accuracy="draft", solver="rodas3p", save="end")
    assert walk.final.theta_1.dtype == jnp.float32
    rolling = jb.RigidScene(SEED.walker, SEED.ground)
    rolled = jb.rigid_walk(rolling, jb.dynamics.rigid_state(start), footsteps=1, accuracy="draft")
    assert rolled.final.theta_1.dtype == jnp.float32
    assert rolled.outcome is jb.Ending.WALKING


def test_one_leaf_in_float32_loses_nothing_of_the_others():
    for field in ("hip_x", "theta_1"):
        start, _ = start_for(SEED, jb.seed_state()._replace(**{field: np.float32(0.1)}))
        assert {leaf.dtype for leaf in start} == {np.dtype("float64")}


def test_plain_numbers_are_float64():
    start, _ = start_for(SEED, jb.State(*map(float, jb.seed_state())))
    assert {leaf.dtype for leaf in start} == {np.dtype("float64")}
