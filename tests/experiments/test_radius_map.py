"""The map of the spectral radius, at its quick size, against the seed's own."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_every_gait_is_found_and_drawn(tmp_path):
    numbers, figures = quick_run("radius_map", tmp_path)
    (figure,) = figures.values()
    assert_is_drawn(figure, unitless={"spectral radius ρ"})
    (row,) = numbers["rows"]
    assert row["found"] == row["stable"] == row["gaits"] == 64
    # At the seed's own K and c it is 0.457: the map spans values to both sides.
    assert numbers["least_radius"] < 0.457 < numbers["largest_radius"] < 1.0
