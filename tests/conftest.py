"""What all tests share."""

import os

import hypothesis
import jax
import pytest

import jaxbiped as jb
from tests.reference import reference_states

# What decides whether a change lands draws the same examples every time; elsewhere they are new.
hypothesis.settings.register_profile("landing", derandomize=True, print_blob=True)
if os.environ.get("CI"):
    hypothesis.settings.load_profile("landing")

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
