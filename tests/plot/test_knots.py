"""Knots, against the motion between them: few, and as exact as asked."""

import numpy as np
import pytest

from jaxbiped.plot._samples import Tolerances, adaptive_knots


def _motion(t):
    """A swing, and a force that lasts a hundredth of a second."""
    return {
        "angle": np.sin(7.0 * t),
        "rate": 7.0 * np.cos(7.0 * t),
        "force": 300.0 * np.exp(-(((t - 0.503) / 2e-3) ** 2)),
    }


@pytest.mark.parametrize("exact", [1e-3, 1e-5])
def test_interpolation_is_as_exact_as_asked_with_few_knots(exact):
    scipy = pytest.importorskip("scipy.interpolate")
    tolerances = Tolerances({"angle": ("rate", exact)}, {"force": 1.0}, shortest=1e-6)
    t, found = adaptive_knots(_motion, np.linspace(0.0, 1.0, 400), tolerances)
    assert (np.diff(t) > 0.0).all()
    assert t[[0, -1]].tolist() == [0.0, 1.0]
    assert len(t) < 150
    between = np.linspace(0.0, 1.0, 30_011)
    curve = scipy.CubicHermiteSpline(t, found["angle"], found["rate"])
    assert np.abs(curve(between) - np.sin(7.0 * between)).max() < exact
    force = np.interp(between, t, found["force"])
    assert np.abs(force - _motion(between)["force"]).max() < 1.5


def test_a_jump_is_split_no_further_than_the_shortest_interval():
    def step(t):
        return {"angle": 0.0 * t, "rate": 0.0 * t, "force": np.where(t > 1 / np.pi, 5.0, 0.0)}

    tolerances = Tolerances({"angle": ("rate", 1.0)}, {"force": 0.1}, shortest=1e-4)
    t, found = adaptive_knots(step, np.linspace(0.0, 1.0, 11), tolerances)
    before, after = t[found["force"] == 0.0].max(), t[found["force"] == 5.0].min()
    assert before < 1 / np.pi < after
    assert 1e-4 / 4 < after - before <= 1e-4
    assert len(t) < 20


def test_a_cubic_needs_no_knots_between_its_ends():
    def cubic(t):
        return {"angle": t**3 - 2.0 * t**2, "rate": 3.0 * t**2 - 4.0 * t}

    tolerances = Tolerances({"angle": ("rate", 1e-12)}, {}, shortest=1e-6)
    t, _ = adaptive_knots(cubic, np.linspace(0.0, 1.0, 33), tolerances)
    assert t.tolist() == [0.0, 1.0]


def test_where_hardly_any_knot_is_needless_all_stay():
    """To drop one of a hundred, which lies between its neighbours, is not worth a pass."""
    t = np.arange(101.0)
    force = np.random.default_rng(0).normal(size=101)
    force[51] = 0.5 * (force[50] + force[52])
    tolerances = Tolerances({}, {"force": 1e-3}, shortest=2.0)
    knots, _ = adaptive_knots(lambda at: {"force": np.interp(at, t, force)}, t, tolerances)
    assert knots.tolist() == t.tolist()
