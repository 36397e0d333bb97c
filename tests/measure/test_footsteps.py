"""Footsteps of the seed's walk against the published numbers and an independent integrator."""

import numpy as np
import pytest

import jaxbiped as jb


@pytest.fixture(scope="module")
def settled():
    scene = jb.seed_scene()
    walk = jb.simulate(scene, jb.seed_state(), footsteps=30)
    return scene, walk, jb.footsteps(scene, walk)


def test_the_walk_settles_at_its_gait(settled):
    _, walk, steps = settled
    assert walk.outcome == jb.Ending.WALKING
    assert len(steps.period_s) == 29
    np.testing.assert_allclose(steps.period_s[:3], [0.4415, 0.4418, 0.4415], atol=1e-4)
    assert steps.period_s[-1] == pytest.approx(0.4408, abs=1e-4)
    assert steps.length_m[-1] == pytest.approx(0.1792, abs=1e-4)
    assert steps.speed_m_s[-1] == pytest.approx(0.4066, abs=1e-4)
    assert steps.peak_normal_N[-1] == pytest.approx(309.0, rel=0.01)
    assert steps.max_penetration_m[-1] == pytest.approx(0.677e-3, abs=1e-6)
    assert steps.double_support_s[-1] == pytest.approx(0.13e-3, abs=0.01e-3)


def test_cost_of_transport_of_the_gait_is_the_slope(settled):
    _, _, steps = settled
    assert steps.cost_of_transport[-1] == pytest.approx(np.sin(0.02), rel=1e-6)


def test_legs_alternate_and_times_increase(settled):
    scene, walk, steps = settled
    strikes = jb.measure.heel_strikes(scene, walk)
    assert len(strikes.time_s) == 30
    assert set(strikes.foot[::2]) == {1}
    assert set(strikes.foot[1::2]) == {2}
    np.testing.assert_allclose(np.diff(strikes.time_s), steps.period_s)


def test_a_steeper_slope():
    scene = jb.seed_scene(slope=0.03)
    steps = jb.footsteps(scene, jb.simulate(scene, jb.seed_state(), footsteps=30))
    assert steps.period_s[-1] == pytest.approx(0.4464, abs=1e-4)
    assert steps.length_m[-1] == pytest.approx(0.2123, abs=1e-4)


def test_strike_times_equal_the_independent_integrators(seed_walk, reference):
    """At a strike the swing foot's sole is at the ground; between reference times by parabola."""
    scene, walk = seed_walk
    times, states = reference
    strikes = jb.measure.heel_strikes(scene, walk)
    assert len(strikes.time_s) == 4
    for time, foot in zip(*strikes, strict=True):
        before = int(np.searchsorted(times, time)) - 1
        span = [before - 2, before - 1, before]
        height = states[span, 1] - 0.32 * np.cos(states[span, 1 + foot]) - 0.08
        fit = np.polyfit(times[span] - time, height, 2)
        assert abs(fit[-1]) < 3e-3
    found, places = walk.at(strikes.time_s), []
    for k, foot in enumerate(strikes.foot):
        depth = jb.dynamics.feet(scene, found)[foot - 1].penetration[k]
        assert abs(float(depth)) < 1e-9
        angle = (found.theta_1, found.theta_2)[foot - 1][k]
        places.append(float(found.hip_x[k] + 0.32 * np.sin(angle)))
    np.testing.assert_allclose(jb.footsteps(scene, walk).length_m, np.diff(places), rtol=1e-12)


def test_a_short_walk_has_no_complete_footstep():
    scene = jb.seed_scene()
    steps = jb.footsteps(scene, jb.simulate(scene, jb.seed_state(), duration=0.5))
    assert all(column.shape == (0,) for column in vars(steps).values())


def test_a_trajectory_without_its_continuous_solution_is_refused():
    scene = jb.seed_scene()
    with pytest.raises(ValueError, match="steps"):
        jb.footsteps(scene, jb.simulate(scene, jb.seed_state(), duration=0.5, save="end"))
