"""The simplest walker's basin, at its quick size, against equations of its own."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_the_simplest_walkers_basin_is_thin_and_as_the_equations_say(tmp_path):
    numbers, figures = quick_run("basin_simplest", tmp_path)
    (figure,) = figures.values()
    assert_is_drawn(figure)
    assert len(figure.axes) >= 2 * len(numbers["slopes"]) == 4
    for found in numbers["slopes"].values():
        assert found["gait_off"] < 1e-6
        assert found["intervals_overlap"]
        assert all(0.0 < row["estimate"] < 0.01 for row in found["fractions"])
        assert all(1e-3 < each["distance"] < 1e-2 for each in found["reach"].values())
        assert found["check"]["disagree"] == 0
        assert 0 < found["check"]["walking"] < found["check"]["starts"]
