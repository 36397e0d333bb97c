"""Labellings that the tests of sweeps share: finding a gait takes seconds."""

import pytest

import jaxbiped as jb
from tests.rigid_walkers import STABLE, simplest_state, simplest_walker


@pytest.fixture(scope="session")
def simplest():
    """A labelling of the simplest walker on its slope of 0.009, with its gait."""
    guess = simplest_state(*STABLE)
    return jb.labelling(simplest_walker(0.009), guess=guess, accuracy="balanced")


@pytest.fixture(scope="session")
def seed():
    """A labelling of the seed's walker, with its gait."""
    return jb.labelling(jb.seed_scene())
