"""Costs and errors of constraint methods, at the quick size, against the minimal one."""

import numpy as np
import pytest

from tests.drawn import assert_is_drawn, labels_of, points_of
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_errors_costs_and_maps(tmp_path):
    numbers, figures = quick_run("constraint_trade", tmp_path)
    assert_is_drawn(figures["trade.png"])
    assert labels_of(figures["trade.png"]) == {"time of a run (s)", "error of the state (SI)"}
    for method in ("standard", "index1"):
        shown = [
            (run["wall_s_run"], run["state_error"])
            for run in numbers["runs"]
            if run["method"] == method
        ]
        np.testing.assert_array_equal(points_of(figures["trade.png"].axes[0], method)[0], shown)
    assert_is_drawn(figures["constants.png"])
    assert {"a (1/s)", "b (1/s)"} <= labels_of(figures["constants.png"])
    runs = {(run["method"], run["rtol_or_dt"]): run for run in numbers["runs"]}
    for method in ("standard", "index1"):
        coarse, fine = runs[method, 1e-4], runs[method, 1e-5]
        assert fine["state_error"] < 0.3 * coarse["state_error"]
        assert fine["steps"] == 10 * coarse["steps"]
    assert runs["index1", 1e-5]["max_violation_m"] < 1e-15
    costs = numbers["costs"]
    assert set(costs) == {"minimal", "standard", "index1"}
    for key in ("single", "batch"):
        usual = costs["standard"][f"{key}_s"]
        for each in costs.values():
            assert each[key] == each[f"{key}_s"] / usual > 0.0
    found = numbers["maps"]["baumgarte"]
    off = np.array(found["max_violation_m"], dtype=float)
    # Faster decay, smaller violation: along a = b, as far as Euler steps stand it.
    assert off[1, 1] < off[0, 0]
    # One that is pulled back faster than the steps are short, without damping, explodes.
    assert found["failed"][0][-1]
