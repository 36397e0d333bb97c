"""Modes of a rigid walk in order of time, against a list of changes that is written down."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.hybrid._mode_history import history_of
from tests.dynamics.test_modes import hsu_chen

BEGIN = np.float64(2.0)
CHANGES = np.array([[0.25, 0.0, 3.0], [0.4, 0.1, 2.0], [9.0, 9.0, 9.0]])
"""Times, states and modes; no room was left for a third one, whose row says nothing."""


def test_each_mode_lasts_until_the_next_one_begins():
    walk = history_of(hsu_chen(), BEGIN, CHANGES, np.int64(2))
    np.testing.assert_array_equal(walk.t, [0.0, 0.25, 0.4, np.inf])
    bent, both = ("shank_2", "shank_2 held"), ("shank_2", "shank_1 held", "shank_2 held")
    assert walk.names == (bent, both, bent)
    np.testing.assert_allclose(walk.durations(0.65), [0.25, 0.15, 0.25], rtol=1e-12)


def test_a_batch_of_walks_has_no_names():
    walk = history_of(hsu_chen(), BEGIN, CHANGES, np.int64(2))
    many = type(walk)(walk.t[None], walk.mode[None], walk.total, walk.feet, walk.stands, walk.modes)
    with pytest.raises(jb.ArgumentError, match="one of a batch at a time"):
        _ = many.names


def test_a_walk_knows_its_modes_and_how_long_they_lasted():
    history = history_of(hsu_chen(), BEGIN, CHANGES, np.int64(2))
    nothing = jb.Trajectory(
        **dict.fromkeys(field.name for field in dataclasses.fields(jb.Trajectory))
        | {"t": np.array([0.0, 0.65])}
    )
    assert nothing.modes == ()
    assert nothing.mode_durations.shape == (0,)
    walk = dataclasses.replace(nothing, mode_history=history)
    assert walk.modes == history.names
    np.testing.assert_allclose(walk.mode_durations, [0.25, 0.15, 0.25], rtol=1e-12)
