"""Walks of mechanisms against SciPy in maximal coordinates, and against their energy."""

import functools

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.dynamics._redundant_state import motion_in
from tests.mechanisms import WALKERS, scene_of, start_of, walk_in_maximal_coordinates

DURATION = 0.12


def _walk(name, **how):
    scene = scene_of(name)
    start = start_of(name, scene)
    walk = jb.simulate(scene, start, duration=DURATION, rtol=1e-9, watch=(), **how)
    return scene, start, walk


@functools.cache
def _by_lanes(name):
    return _walk(name, engine="lanes")


@pytest.mark.parametrize("name", WALKERS)
def test_walks_are_those_of_maximal_coordinates(name):
    scene, start, walk = _by_lanes(name)
    last = type(start)(*(np.asarray(leaf)[-1] for leaf in walk.state))
    found = motion_in(scene, last)
    found = [found.x, found.z, *found.angles, found.vx, found.vz, *found.rates]
    expected = walk_in_maximal_coordinates(scene.mechanism, start, DURATION)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", WALKERS)
def test_ledgers_close(name):
    scene, _, walk = _by_lanes(name)
    books = jb.energy_ledger(scene, walk)
    assert abs(float(books.residual[0])) < 1e-7
    assert float(books.damper_loss[0]) > 0.0
    assert float(books.friction_loss[0]) > 0.0


@pytest.mark.nightly
def test_xla_walks_as_lanes_do():
    """Of the mechanism that has most in it: stops, two chains of two bodies, a mass at the hip."""
    *_, lanes = _walk("kneed", save="end", engine="lanes")
    *_, xla = _walk("kneed", save="end", engine="xla")
    for one, other in zip(lanes.state, xla.state, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-7)
