"""What gradients cost, at its quick size, against the solves that differences would take."""

import pytest

from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_costs_over_the_number_of_parameters(tmp_path):
    numbers, figures = quick_run("gradient_cost", tmp_path)
    assert not figures
    (row,) = numbers["rows"]
    assert row["parameters"] == 4
    assert row["return_ms"] > 0.0
    assert row["radius_by_differences_ms"] == pytest.approx(8.0 * row["return_ms"])
