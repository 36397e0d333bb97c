"""Walking on level ground, at its quick size, against its costs and checks."""

import numpy as np
import pytest

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_costs_on_level_ground(tmp_path):
    numbers, figures = quick_run("level_ground", tmp_path)
    figure = figures["level_ground.png"]
    assert_is_drawn(figure)
    pairs = numbers["simplest"]
    assert len(pairs) == 3
    assert not numbers["simplest_without_gait"]
    for pair in pairs:
        # Kuo 2002: P = v tan α, work ½ P², and a quarter of what gravity must make up for.
        assert pair["impulse_over_speed_tan"] == pytest.approx(1.0, abs=1e-9)
        assert pair["work_over_half_square"] == pytest.approx(1.0, abs=1e-9)
        assert pair["ratio"] == pytest.approx(4.0, rel=0.5 * pair["angle_rad"] ** 2)
    shown = points_of(figure.axes[0], "push-off")[0]
    assert shown[:, 1].tolist() == [pair["cost"] for pair in pairs]
    for name, curve in numbers["seed"].items():
        assert all(point["found"] and point["stable"] for point in curve)
        speeds = [point["speed_m_s"] for point in curve]
        assert speeds == sorted(speeds)
        drawn = points_of(figure.axes[1], name)[0]
        np.testing.assert_array_equal(drawn[:, 0], speeds)
    (design,) = numbers["designs"]
    assert design["outcome"] == "converged"
    assert design["speed_m_s"] == pytest.approx(0.28, rel=1e-6)
    assert design["cost_of_transport"] < design["seed_cost"]
    star = points_of(figure.axes[1], "push-off, optimised")[0]
    assert star[:, 1].tolist() == [design["cost_of_transport"]]
