"""Robust designs and the front, at the quick size, against the design for one scene."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_the_worst_member_costs_speed_and_the_front_is_a_trade(tmp_path):
    numbers, figures = quick_run("optimise_robust", tmp_path)
    (figure,) = figures.values()
    unitless = {"bound of the spectral radius", "spectral radius under scatter"}
    assert_is_drawn(figure, unitless=unitless)
    found = numbers["designs"]
    assert found["worst"]["objective"] < found["mean"]["objective"]
    assert found["worst"]["share_beyond_bound"] <= found["nominal"]["share_beyond_bound"]
    loose, strict = numbers["front"]["speed_m_s"]
    assert loose > strict
