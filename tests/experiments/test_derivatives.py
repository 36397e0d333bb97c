"""Derivatives, at their quick size, against differences of finer walks and a finer reference."""

import numpy as np
import pytest

from tests.drawn import points_of
from tests.experiments.quick import drawn_run, quick_run

pytestmark = pytest.mark.nightly


def test_every_derivative_through_an_ending_is_right_or_refused(tmp_path):
    numbers, _ = quick_run("event_derivatives", tmp_path)
    assert len(numbers["endings"]) == 5
    for row in numbers["endings"]:
        for error in row["errors"].values():
            if row["ends"] == "every step":
                assert 'save="steps"' in error
            else:
                assert error < 1e-4
    for draft, balanced, tight in numbers["laws"]["stribeck"].values():
        assert draft < 1e-3
        assert balanced < 4e-4  # of 24 tolerances around it the worst has 3.2e-4
        assert tight < 2e-6
    assert "kelvin-voigt" in (tmp_path / "event_derivatives.md").read_text()


def test_every_option_of_a_simulation_returns_what_a_finer_walk_does(tmp_path):
    numbers, _ = quick_run("simulation_matrix", tmp_path)
    for cells in numbers["cells"].values():
        assert len(cells) == 4
        assert max(cells.values()) < 5e-6
    assert "| `save=times` |" in (tmp_path / "simulation_matrix.md").read_text()


def test_every_parameter_s_derivative_of_a_mechanism_is_right(tmp_path):
    numbers, _ = quick_run("mechanism_derivatives", tmp_path)
    (row,) = numbers["rows"]
    assert min(row[f"{accuracy}: judged"] for accuracy in ("draft", "balanced", "tight")) >= 10
    assert row["draft"] < 1e-3
    assert row["balanced"] < 1e-4
    assert row["tight"] < 2e-6  # the truths are differences, known to 1e-6
    assert "| torso coupled | a time |" in (tmp_path / "mechanism_derivatives.md").read_text()


def test_both_precautions_make_derivatives_follow_their_tolerance(tmp_path):
    # Units stand in the titles, of what is in error.
    bare = {"error", "attempted steps of a footstep"}
    numbers, figures = drawn_run("gradient_accuracy", tmp_path, unitless=bare)
    points = numbers["points"]["exact laws"]
    keys = ("state", "period_s", "unit_multiplier", "period_slope")
    for ax, key in zip(figures["gradient_accuracy.png"].axes, keys, strict=True):
        for name, row in points.items():
            shown = [(point["steps"], point[key]) for point in row]
            np.testing.assert_array_equal(points_of(ax, name)[0], shown)
    assert numbers["reference"]["exact laws"]["unit_multiplier"] < 1e-6
    for name in ("norm", "both"):
        assert points[name][-1]["unit_multiplier"] < 1e-3
        assert points[name][-1]["period_slope"] < 1e-3
    assert points["plain"][-1]["unit_multiplier"] > 1e-3
    assert all(row[-1]["state"] < 1e-5 for row in points.values())
    (row,) = numbers["costs"]["rows"]
    assert row["parameters"] == 4
    assert row["return_ms"] > 0.0
    assert row["radius_by_differences_ms"] == pytest.approx(8.0 * row["return_ms"])
