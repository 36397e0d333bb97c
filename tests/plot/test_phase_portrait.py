import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.plot import phase_portrait


def _curves(figure):
    return [line for line in figure.axes[0].lines if line.get_label().startswith("leg")]


def test_one_leg_as_in_the_paper(seed_walk):
    _, walk = seed_walk
    figure = phase_portrait(*seed_walk)
    (curve,) = _curves(figure)
    angle, rate = curve.get_data()
    drawn = set(zip(angle, rate, strict=True))
    steps = zip(np.asarray(walk.state.theta_1), np.asarray(walk.state.omega_1), strict=True)
    assert set(list(steps)[1:-1]) <= drawn
    assert (angle[0], rate[0]) == pytest.approx((-0.2479, -0.0052))
    assert "(rad)" in figure.axes[0].get_xlabel()
    assert "(rad/s)" in figure.axes[0].get_ylabel()


def test_both_legs(seed_walk):
    _, walk = seed_walk
    first, second = _curves(phase_portrait(*seed_walk, legs=(1, 2)))
    assert first.get_ydata().max() == pytest.approx(float(walk.state.omega_1.max()), rel=1e-5)
    assert second.get_ydata().max() == pytest.approx(float(walk.state.omega_2.max()), rel=1e-5)
    assert first.get_color() != second.get_color()


@pytest.mark.parametrize("legs", [(), (0,), (1, 3)])
def test_legs_are_numbered_1_and_2(seed_walk, legs):
    with pytest.raises(jb.ArgumentError, match="legs"):
        phase_portrait(*seed_walk, legs=legs)
