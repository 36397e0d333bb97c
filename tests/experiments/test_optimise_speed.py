"""The fastest gait and the calmest one, at the quick size, against the seed's."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.nightly


def test_the_radius_is_halved_at_no_loss_of_speed(tmp_path):
    numbers, figures = quick_run("optimise_speed", tmp_path)
    (figure,) = figures.values()
    axes = {"gait sensitivity norm", "spectral radius"}
    axes |= {"real part of a multiplier", "imaginary part"}
    assert_is_drawn(figure, unitless=axes)
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
