"""Accuracy of derivatives, at its quick size, against a reference far finer."""

import numpy as np
import pytest

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_both_precautions_make_derivatives_follow_their_tolerance(tmp_path):
    numbers, figures = quick_run("gradient_accuracy", tmp_path)
    points = numbers["points"]["exact laws"]
    figure = figures["gradient_accuracy.png"]
    # Units stand in the titles, of what is in error.
    assert_is_drawn(figure, unitless={"error", "attempted steps of a footstep"})
    keys = ("state", "period_s", "unit_multiplier", "period_slope")
    for ax, key in zip(figure.axes, keys, strict=True):
        for name, row in points.items():
            shown = [(point["steps"], point[key]) for point in row]
            np.testing.assert_array_equal(points_of(ax, name)[0], shown)
    assert numbers["reference"]["exact laws"]["unit_multiplier"] < 1e-6
    for name in ("norm", "both"):
        assert points[name][-1]["unit_multiplier"] < 1e-3
        assert points[name][-1]["period_slope"] < 1e-3
    assert points["plain"][-1]["unit_multiplier"] > 1e-3
    assert all(row[-1]["state"] < 1e-5 for row in points.values())
