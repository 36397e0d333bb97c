"""Elasticities of a critical slope, at the quick size, against differences."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_elasticities_are_those_of_differences(tmp_path):
    numbers, figures = quick_run("bifurcation_elasticities", tmp_path)
    assert_is_drawn(figures["bifurcation_elasticities.png"], unitless={"parameter"})
    found = numbers["cases"]["doubling, rigid"]
    assert found["slope_rad"] == pytest.approx(0.100401149, abs=1e-8)
    row = found["parameters"]["r"]
    assert row["elasticity"] == pytest.approx(row["by_differences"], rel=1e-5)
