"""The fastest gait and the calmest one, at the experiment's quick size."""

import pytest

from tests.drawn import assert_is_drawn
from tests.experiments.quick import quick_run

pytestmark = pytest.mark.slow


def test_the_radius_falls_at_no_loss_of_speed(tmp_path):
    numbers, figures = quick_run("optimise_speed", tmp_path)
    (figure,) = figures.values()
    assert_is_drawn(figure, unitless={"iteration", "spectral radius", *_PARTS})
    seed, calm = numbers["seed"], numbers["calmest"]
    assert calm["measures"]["spectral_radius"] < 0.5 * seed["spectral_radius"]
    assert calm["measures"]["speed"] >= seed["speed_m_s"] * (1.0 - 1e-5)
    for certificate in (seed["certificate"], calm["certificate"]):
        assert certificate["stable"] is True
        assert certificate["returned"] is True
    fast = numbers["fastest"]["trust-region"]
    assert fast["measures"]["speed"] > seed["speed_m_s"]
    assert fast["measures"]["spectral_radius"] <= 0.4 * (1.0 + 1e-5)


_PARTS = ("real part of a multiplier", "imaginary part")
