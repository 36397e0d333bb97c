"""The seed's branch along the slope, at its quick size, against bisection."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_stability_is_lost_where_bisection_says(tmp_path):
    numbers, figures = quick_run("slope_branch", tmp_path)
    (figure,) = figures.values()
    assert_is_drawn(figure)
    compliant, rigid = numbers["scenes"]["stribeck"], numbers["scenes"]["rigid"]
    assert [row["kind"] for row in compliant["losses"]] == ["fold", "period-doubling"]
    assert [row["kind"] for row in rigid["losses"]] == ["period-doubling"]
    for found in (compliant, rigid):
        for row in found["losses"]:
            assert abs(abs(complex(*row["multiplier"])) - 1.0) < 1e-6
            # Multipliers change by at most 50 for each rad; the bracket is of 5e-8 rad.
            assert row["off"] < 1e-7 + row["error"] / 25.0
    assert numbers["hundred_gaits"]["gaits"] >= 100
