"""Phase portraits of a leg, against the walk's angles and rates."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.plot import phase_portrait
from tests.drawn import legend_of


def _curves(figure):
    return [line for line in figure.axes[0].lines if line.get_label().startswith("leg")]


def test_one_leg_as_in_the_paper_or_both(seed_walk):
    _, walk = seed_walk
    (curve,) = _curves(phase_portrait(*seed_walk))
    angle, rate = curve.get_data()
    drawn = set(zip(angle, rate, strict=True))
    steps = zip(np.asarray(walk.state.theta_1), np.asarray(walk.state.omega_1), strict=True)
    assert set(list(steps)[1:-1]) <= drawn
    assert (angle[0], rate[0]) == pytest.approx((-0.2479, -0.0052))
    first, second = _curves(phase_portrait(*seed_walk, legs=(1, 2)))
    assert first.get_ydata().max() == pytest.approx(float(walk.state.omega_1.max()), rel=1e-5)
    assert second.get_ydata().max() == pytest.approx(float(walk.state.omega_2.max()), rel=1e-5)
    assert first.get_color() != second.get_color()


def test_the_last_stride_is_strong_over_the_whole_walk(seed_walk):
    scene, walk = seed_walk
    (ax,) = phase_portrait(scene, walk).axes
    whole, last = ax.lines[:2]
    strikes = jb.measure.heel_strikes(scene, walk)
    since = strikes.time_s[strikes.foot == 1][-2]
    assert last.get_label() == f"last stride of leg 1, from {since:.2f} s"
    assert whole.get_alpha() < 0.5 < (last.get_alpha() or 1.0)
    assert last.get_linewidth() > whole.get_linewidth()
    drawn = last.get_xydata()
    expected = walk.at(since)
    assert drawn[0] == pytest.approx((float(expected.theta_1), float(expected.omega_1)), abs=2e-2)
    assert tuple(drawn[-1]) == (float(walk.state.theta_1[-1]), float(walk.state.omega_1[-1]))
    assert legend_of(ax) == ["leg 1, whole walk", last.get_label(), "start"]


def test_arrows_run_the_way_time_does(seed_walk):
    (ax,) = phase_portrait(*seed_walk).axes
    heads = [text for text in ax.texts if text.get_text() == ""]
    assert len(heads) == 4
    for head in heads:
        (angle, rate), (before, _) = head.xy, head.get_position()
        # A positive rate is a growing angle, whatever the walk.
        assert (angle - before) * rate > 0.0


def test_a_short_motion_has_no_stride_and_an_end_has_a_name():
    scene = jb.seed_scene()
    (ax,) = phase_portrait(scene, jb.simulate(scene, jb.seed_state(), duration=0.1)).axes
    (curve,) = _curves(ax.figure)
    assert (curve.get_label(), curve.get_alpha()) == ("leg 1", None)
    steep = jb.seed_scene(slope=0.04)
    walk = jb.simulate(steep, jb.seed_state(), duration=10.0)
    (ax,) = phase_portrait(steep, walk).axes
    assert "fell forward" in legend_of(ax)


@pytest.mark.parametrize("legs", [(), (0,), (1, 3), 1])
def test_legs_are_numbered_1_and_2(seed_walk, legs):
    with pytest.raises(jb.ArgumentError, match="legs"):
        phase_portrait(*seed_walk, legs=legs)
