"""Walks of mechanisms against their energy, and by one engine against the other."""

import functools

import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import WALKERS, scene_of, start_of

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
def test_ledgers_close(name):
    scene, _, walk = _by_lanes(name)
    books = jb.measure.energy_ledger(scene, walk)
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
