"""Figures over time, against the walk's angles and penetrations."""

import numpy as np
import pytest

from jaxbiped.plot import leg_angles, penetrations


def test_angles_at_the_solvers_steps(seed_walk):
    _, walk = seed_walk
    figure = leg_angles(*seed_walk)
    steps = np.asarray(walk.t)[1:-1]
    lines = figure.axes[0].lines
    for line, angle in zip(lines, (walk.state.theta_1, walk.state.theta_2), strict=True):
        t, drawn = line.get_data()
        np.testing.assert_array_equal(drawn[np.searchsorted(t, steps)], np.asarray(angle)[1:-1])
        assert (t[0], t[-1]) == (0.0, 2.0)
    assert "(s)" in figure.axes[0].get_xlabel()
    assert "(rad)" in figure.axes[0].get_ylabel()
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == [
        "leg 1",
        "leg 2",
    ]


def test_depth_in_millimetres_while_a_foot_touches(seed_walk):
    _, walk = seed_walk
    (ax,) = penetrations(*seed_walk).axes
    assert "(mm)" in ax.get_ylabel()
    assert ax.get_ylim()[0] == 0.0
    for leg, line in enumerate(ax.lines, start=1):
        t, drawn = line.get_data()
        state = walk.at(t)
        angle, rate = (state.theta_1, state.omega_1) if leg == 1 else (state.theta_2, state.omega_2)
        depth = 1e3 * (0.08 - np.asarray(state.hip_z) + 0.32 * np.cos(np.asarray(angle)))
        touching = (depth > 1e-6) & (np.asarray(rate) < -1e-6)
        np.testing.assert_allclose(drawn[touching], depth[touching], atol=2e-6)
        assert drawn[touching].max() == pytest.approx(0.69, abs=0.02)
        swinging = np.asarray(rate) > 0.0
        assert np.isnan(drawn[swinging & (depth > 0.0)]).all()
        assert np.isnan(drawn).mean() > 0.3
        assert np.nanmin(drawn) == 0.0
