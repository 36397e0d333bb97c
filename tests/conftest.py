"""What all tests share."""

import jax
import pytest

import jaxbiped as jb
from tests.reference import reference_states

jax.config.update("jax_numpy_dtype_promotion", "strict")


@pytest.fixture(scope="session")
def seed_walk():
    """The seed's walker over two seconds at the tight accuracy: scene and trajectory."""
    scene = jb.seed_scene()
    return scene, jb.simulate(scene, jb.seed_state(), duration=2.0, accuracy="tight")


@pytest.fixture(scope="session")
def reference():
    """The seed's walk by an independent program and integrator: (times, states (n, 8))."""
    return reference_states()
