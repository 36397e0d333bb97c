"""Robustness of the search, at its quick size, against walks that settle."""

import numpy as np
import pytest

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_no_gait_that_walks_settle_on_is_missed(tmp_path):
    numbers, figures = quick_run("search_robustness", tmp_path)
    assert set(numbers) == {"slope", "mu", "simplest"}
    (figure,) = figures.values()
    assert_is_drawn(figure)
    drawn = np.concatenate(points_of(figure.axes[0]))
    found = [(row["value"], row["period"] / row["cycle"]) for row in numbers["slope"]]
    np.testing.assert_allclose(drawn, found)
    rows = [row for family in numbers.values() for row in family]
    assert not [row for row in rows if row["verdict"] == "missed"]
    assert [row["verdict"] for row in numbers["slope"]] == ["agrees"] * 3
    for row in numbers["slope"]:
        assert abs(row["period"] - row["walked"]) < 1e-6
