"""Long walks, at the quick size, against the gait that they stay on."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_footsteps_stay_on_the_gait_and_repeat(tmp_path):
    numbers, figures = quick_run("long_walks", tmp_path)
    label = "duration's difference from the period [relative]"
    assert_is_drawn(figures["long_walks.png"], unitless={label})
    assert numbers["outcome"] == "walking"
    assert numbers["footsteps"] == 2000
    assert numbers["repeats"] is True
    assert numbers["mean_s"] == pytest.approx(numbers["period_s"], rel=1e-6)
    assert numbers["largest_deviation_s"] < 1e-5 * numbers["period_s"]
    assert numbers["peak_MiB"][1] < numbers["peak_MiB"][0] + 100.0
