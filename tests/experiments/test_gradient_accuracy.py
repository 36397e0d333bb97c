import pytest

from tests.experiments.quick import quick_numbers

pytestmark = pytest.mark.slow


def test_both_precautions_make_derivatives_follow_their_tolerance(tmp_path):
    numbers = quick_numbers(
        "gradient_accuracy",
        tmp_path,
        keys={"reference_tolerance", "reference", "points"},
        pictures={"gradient_accuracy.png"},
    )
    points = numbers["points"]["exact laws"]
    assert numbers["reference"]["exact laws"]["unit_multiplier"] < 1e-6
    for name in ("norm", "both"):
        assert points[name][-1]["unit_multiplier"] < 1e-3
        assert points[name][-1]["period_slope"] < 1e-3
    assert points["plain"][-1]["unit_multiplier"] > 1e-3
    assert all(row[-1]["state"] < 1e-5 for row in points.values())
