"""Grazes of walks that are labelled, against starts known to touch or miss by a hair."""

import dataclasses

import numpy as np
import pytest
from extreme_cases.case import check_numbers
from extreme_cases.grazing import START, grazing_scene, lowest

import jaxbiped as jb
from tests.sweep.walkers import gaitless

pytestmark = pytest.mark.slow

SCENE = grazing_scene("kelvin-voigt")
DEPTHS = np.array([1e-4, 2e-8, 1e-9, -1e-9, -2e-8, -1e-4])
"""How deep a swinging foot would come had there been no ground [m]; known to 1.2e-6 m."""


@pytest.fixture(scope="module")
def states():
    touching = START[1] - lowest(check_numbers(SCENE))
    columns = [np.full(len(DEPTHS), value) for value in START]
    columns[1] = touching - DEPTHS
    return jb.State(*columns)


def test_starts_whose_walk_grazes_are_counted(states):
    # Of the seed's gait, for only the way is looked at.
    label = jb.labelling(jb.seed_scene(), accuracy=1e-3)
    label = dataclasses.replace(label, scene=SCENE)
    effort = gaitless(SCENE, jb.State(*START), accuracy=1e-3, footsteps=1).effort
    told = label._label_once(states, {}, effort)
    assert np.array_equal(told.grazes > 0, np.abs(DEPTHS) < 1e-6)
    plain = label._label_once(states, {}, effort._replace(wanted=None))
    assert plain.grazes is None
    for name in ("label", "footsteps", "time", "distance", "attempted"):
        np.testing.assert_array_equal(getattr(told, name), getattr(plain, name))
    found = label(states)
    assert np.all(found.doubt[np.abs(DEPTHS) < 1e-6] > 0)
