"""The ladder of fidelity, at its quick size, against the rigid limit."""

import numpy as np
import pytest

from tests.drawn import assert_is_drawn, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_rungs_and_the_way_to_the_rigid_limit(tmp_path):
    numbers, figures = quick_run("ladder", tmp_path)
    measures = numbers["measures"]
    assert_is_drawn(figures["ladder.png"])
    costs = points_of(figures["ladder.png"].axes[0], "in a batch")[0][:, 0]
    assert costs.tolist() == [cost["batch_us"] for cost in numbers["costs"].values()]
    assert_is_drawn(figures["rigid_limit.png"], unitless={"factor of the path, $s$"})
    for name, path in numbers["paths"].items():
        gaps = points_of(figures["rigid_limit.png"].axes[0], name)[0]
        np.testing.assert_array_equal(gaps, np.transpose([path["factors"], np.abs(path["period"])]))
    (pair,) = numbers["equal_errors"]
    assert pair["rigid"]["error"] <= pair["stribeck"]["error"]
    assert measures["rigid"]["period"] == pytest.approx(0.44378, abs=5e-6)
    assert measures["stribeck"]["period"] == pytest.approx(0.440835, abs=2e-6)
    assert numbers["costs"]["rigid"]["error"] <= numbers["costs"]["stribeck"]["error"]
    # Stiffness alone leads past the rigid gait; damping leads towards it.
    stiff, damped = numbers["paths"]["K alone"], numbers["paths"]["c alone"]
    assert stiff["period"][-1] > 0.0 > stiff["period"][0]
    assert damped["step_length"] == sorted(damped["step_length"])
    assert damped["step_length"][-1] < 0.0
