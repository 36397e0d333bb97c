"""The figure of the feet's penetration over time, against the walk's."""

import numpy as np
import pytest

from jaxbiped.plot import penetrations


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
