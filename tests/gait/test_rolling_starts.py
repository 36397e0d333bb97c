"""Scattered starts, against rolling without slip of the stance foot."""

import numpy as np
import pytest

import jaxbiped as jb


def test_rolling_starts_do_not_slip_and_begin_with_the_seeds():
    scene = jb.seed_scene(l=0.5)
    starts = jb.gait.rolling_starts(scene, 5)
    both = jb.dynamics.feet(scene, starts)
    np.testing.assert_allclose(both.foot_2.slip_speed, 0.0, atol=1e-14)
    np.testing.assert_allclose(both.foot_2.penetration_rate, 0.0, atol=1e-14)
    np.testing.assert_allclose(both.foot_2.penetration, both.foot_2.penetration[0], atol=1e-14)
    seed = jb.seed_state()
    assert float(starts.theta_1[0]) == float(seed.theta_1)
    assert np.ptp(np.asarray(starts.theta_1)) > 0.0
    assert not np.allclose(starts.omega_2, jb.gait.rolling_starts(scene, 5, seed=1).omega_2)


def test_bad_arguments():
    with pytest.raises(jb.ArgumentError, match="count"):
        jb.gait.rolling_starts(jb.seed_scene(), 0)
    with pytest.raises(jb.ArgumentError, match="spread"):
        jb.gait.rolling_starts(jb.seed_scene(), 3, spread=0.0)
