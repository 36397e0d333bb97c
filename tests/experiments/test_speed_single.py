"""Speed of single simulations, at its quick size, against an independent solve."""

import numpy as np
import pytest

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_agrees_with_an_independent_solve(tmp_path):
    numbers, figures = quick_run("speed_single", tmp_path, alone=True)
    assert numbers["reference_difference"] < 1e-8
    assert min(point["error"] for point in numbers["points"]["rodas4"]) < 1e-7
    (figure,) = figures.values()
    assert_is_drawn(figure)
    shown = np.concatenate(points_of(figure.axes[0]))
    for point in numbers["points"]["rodas4"]:
        assert point["error"] in shown[:, 0]
