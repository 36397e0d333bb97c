"""Designs and fitted parameters, at the quick size, against the seed's gait and known truths."""

import pytest

from tests.drawn import assert_is_drawn, labels_of
from tests.experiments.quick import drawn_run, quick_run

pytestmark = pytest.mark.nightly


def test_the_radius_is_halved_at_no_loss_of_speed(tmp_path):
    numbers, _ = drawn_run("optimise_speed", tmp_path)
    told = numbers["designs"]
    seed = told["seed"]["measures"]
    for name in ("calmest", "least radius"):
        measures = told[name]["measures"]
        assert measures["spectral_radius"] <= 0.5 * seed["spectral_radius"] * (1.0 + 1e-4)
        assert measures["speed"] >= seed["speed"] * (1.0 - 1e-4)
    for each in told.values():
        assert each["certificate"]["stable"] is True
        assert each["certificate"]["returned"] is True
    fast = numbers["fastest"]["trust-region"]["measures"]
    assert fast["speed"] > seed["speed"]
    assert fast["spectral_radius"] <= 0.4 * (1.0 + 1e-4)
    descent = numbers["descents"]["minimise spectral_radius"]
    assert descent["objective"] < seed["spectral_radius"]
    assert descent["evaluations"] >= descent["iterations"] > 1
    # The worst member costs speed, and the front is a trade.
    found = numbers["robust"]["designs"]
    assert found["worst"]["objective"] < found["mean"]["objective"]
    assert found["worst"]["share_beyond_bound"] <= found["nominal"]["share_beyond_bound"]
    loose, strict = numbers["robust"]["front"]["speed_m_s"]
    assert loose > strict


def test_estimates_scatter_as_their_errors_say(tmp_path):
    numbers, figures = quick_run("identify", tmp_path)
    assert numbers["sets"] == 3
    assert all(each["converged"] == each["sets"] == 3 for each in numbers["settings"].values())
    assert "xi" in numbers["without_upper_end_with_xi"]
    for held in numbers["parameters"].values():
        # Three estimates scatter; four standard errors are a wide gate, a wrong Jacobian wider.
        off = abs(held["mean_estimate"] - held["truth"])
        assert off < 4.0 * held["mean_standard_error"]
        assert 0.0 < held["mean_standard_error"] < 0.1 * held["truth"]
    (figure,) = figures.values()
    assert_is_drawn(figure, unitless=set(labels_of(figure)))
