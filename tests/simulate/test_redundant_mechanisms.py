"""Walks of mechanisms in redundant coordinates against their walks in minimal ones."""

import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import scene_of, start_of

DURATION = 0.12
HOW = dict(duration=DURATION, rtol=1e-8, watch=(), save="end")


def _gap(name, method, orientation, engine):
    scene = scene_of(name)
    start = start_of(name, scene)
    held = jb.RedundantScene(scene, method, orientation)
    found = jb.simulate(held, start, engine=engine, extremes=jb.dynamics.violation, **HOW)
    assert found.engine == engine
    truth = jb.simulate(scene, start, engine="lanes", **HOW)
    final = jb.dynamics.minimal_state(held, found.final)
    assert type(final) is type(truth.final)
    return np.abs(np.array(final) - np.array(truth.final)).max(), found.highest


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method", "orientation"),
    [
        pytest.param("torso", "standard", "angle", marks=pytest.mark.nightly),
        ("coupled", "index1", "angle"),
        pytest.param("kneed", "described", "angle", marks=pytest.mark.nightly),
        pytest.param("five", "index1aug", "angle", marks=pytest.mark.nightly),
        pytest.param("coupled", "index1", "euler", marks=pytest.mark.nightly),
    ],
)
def test_lanes_walk_as_in_minimal_coordinates(name, method, orientation):
    gap, off = _gap(name, method, orientation, "lanes")
    assert gap < 1e-6
    bound = 1e-14 if method != "standard" else 1e-6
    assert max(map(float, off)) < bound
    assert float(off.position) > 0.0
    assert (float(off.angle) > 0.0) == (name == "coupled")


@pytest.mark.nightly
def test_xla_walks_as_in_minimal_coordinates():
    gap, off = _gap("coupled", "baumgarte", "angle", "xla")
    assert gap < 1e-6
    assert 0.0 < float(off.angle) < 1e-6
