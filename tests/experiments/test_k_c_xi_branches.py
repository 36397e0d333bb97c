"""Branches along K, c and ξ, at the quick size, against each other and their curves."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_branches_and_curves(tmp_path):
    numbers, figures = quick_run("k_c_xi_branches", tmp_path)
    assert set(figures) == {"k_c_xi_branches.png", "k_c_xi_curves.png"}
    for figure in figures.values():
        assert_is_drawn(figure)
    assert all(numbers["branches"]["K"]["stable"])
    for curve in numbers["curves"]["K"]:
        assert max(curve["off"]) < 1e-6
        assert len(curve["values"]) == 5
    # The stiffer the ground, the flatter the slope that still keeps the gait.
    fold = numbers["curves"]["K"][0]["values"]
    assert fold == sorted(fold, key=lambda pair: -pair[0])
    assert fold == sorted(fold, key=lambda pair: pair[1])
