"""Starts of a search: the fitted one against walkers of any size, others against rolling."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait._search_starts import (
    default_guess,
    scattered_start_count,
    starts_scattered_by,
)
from tests.mechanisms import KNEE, KNEES, TORSO, leg
from tests.solve.test_accuracy import sized


def test_the_seeds_own_start_is_the_papers():
    assert [float(x) for x in default_guess(jb.seed_scene())] == [float(x) for x in jb.seed_state()]


@pytest.mark.parametrize(("length", "time"), [(1e-3, 1e-3**0.5), (1e3, 2.0)])
def test_a_walker_of_any_size_starts_alike(length, time):
    scene, start, _ = sized(length, time)
    fitted = default_guess(scene)
    np.testing.assert_allclose(np.array(fitted), np.array(start), rtol=1e-12)
    walk = jb.simulate(scene, fitted, duration=0.45 * time, save="end", engine="lanes")
    assert walk.outcome == jb.Ending.WALKING


def test_knees_begin_at_their_stops_and_a_torso_upright_whatever_springs_there_are():
    walker = jb.Mechanism(
        root_mass=1.0,
        bodies=(TORSO, *leg(1), *leg(2)),
        feet=tuple(jb.Foot(f"shank_{i}", centre=0.136, radius=0.08) for i in (1, 2)),
        joints=(
            *(jb.Stop(f"shank_{i}", upper=0.2, lower=-0.5, law=KNEE) for i in (1, 2)),
            *(jb.Spring(f"shank_{i}", stiffness=2.0, damping=0.1) for i in (1, 2)),
        ),
        mirror=KNEES,
    )
    start = default_guess(dataclasses.replace(jb.seed_scene(), walker=walker))
    assert float(start.theta_torso) == 0.0
    for i in (1, 2):
        bent = float(getattr(start, f"theta_shank_{i}") - getattr(start, f"theta_thigh_{i}"))
        assert bent == pytest.approx(0.2, abs=1e-14)


def test_rolling_starts_do_not_slip_and_begin_with_the_seeds():
    scene = jb.seed_scene(l=0.5)
    starts = jb.gait.rolling_starts(scene, 5)
    both = jb.dynamics.feet(scene, starts)
    np.testing.assert_allclose(both[1].slip_speed, 0.0, atol=1e-14)
    np.testing.assert_allclose(both[1].penetration_rate, 0.0, atol=1e-14)
    np.testing.assert_allclose(both[1].penetration, both[1].penetration[0], atol=1e-14)
    seed = jb.seed_state()
    assert float(starts.theta_1[0]) == float(seed.theta_1)
    assert np.ptp(np.asarray(starts.theta_1)) > 0.0
    assert not np.allclose(starts.omega_2, jb.gait.rolling_starts(scene, 5, seed=1).omega_2)


@pytest.mark.parametrize(("count", "spread", "named"), [(0, 0.3, "count"), (3, 0.0, "spread")])
def test_bad_arguments(count, spread, named):
    with pytest.raises(jb.ArgumentError, match=named):
        jb.gait.rolling_starts(jb.seed_scene(), count, spread=spread)


def test_each_number_scatters_a_start_of_which_the_stance_foot_stands_as_deep():
    scene = jb.seed_scene()
    count = scattered_start_count(scene)
    scatter = np.pad(0.3 * np.eye(count), ((0, 0), (1, 0)))
    starts = starts_scattered_by(scene, scatter)
    angles = np.stack([starts.theta_1, starts.theta_2, starts.omega_1, starts.omega_2])
    moved = np.abs(angles[:, 1:] - angles[:, :1]) > 1e-3
    np.testing.assert_array_equal(moved.any(axis=0), True)
    guess = default_guess(scene)
    # The foot is a circle about a point on the leg: what is below that does not turn.
    depths = starts.hip_z - 0.32 * np.cos(starts.theta_2)
    expected = float(guess.hip_z) - 0.32 * np.cos(float(guess.theta_2))
    np.testing.assert_allclose(depths, expected, atol=1e-9)
