"""Starts, against where they are said to lie in any chunk; what stops allow, against limits."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxbiped as jb
from jaxbiped.dynamics._state import recurring_names
from jaxbiped.hybrid._admissible_directions import admissible_directions, independent_names
from jaxbiped.sweep.starts._starts import sequence_points
from tests.dynamics.test_modes import ANGLES, RATES, hsu_chen
from tests.sweep.walkers import gaitless, same

SCENE = jb.seed_scene()
LABELLING = gaitless(SCENE, jb.seed_state(), accuracy="draft")
KNEED = hsu_chen()
HELD = KNEED.state(**ANGLES, **RATES, held="shank_2")
BOUNDS = {"theta_stance": (-0.1, 0.3), "omega_stance": (-2.0, 0.0), "hip_vx": (0.1, 0.9)}


def test_the_last_axis_of_a_grid_runs_fastest():
    axes = {"omega_stance": [-1.0, -2.0], "slope": [0.01, 0.02, 0.03]}
    starts = jb.starts.grid(SCENE, axes)
    assert starts.shape == (2, 3)
    batch = starts.batch(LABELLING, 1, 5)
    np.testing.assert_array_equal(batch.states.omega_2, [-1.0, -1.0, -2.0, -2.0])
    np.testing.assert_array_equal(batch.parameters["slope"], [0.02, 0.03, 0.01, 0.02])
    np.testing.assert_array_equal(batch.states.theta_1, np.full(4, float(jb.seed_state().theta_1)))
    np.testing.assert_array_equal(starts.parameters["slope"], axes["slope"])


def test_placed_feet_are_as_deep_and_slip_as_slowly_as_in_the_gait():
    axes = {"theta_stance": np.linspace(-0.3, 0.4, 5), "omega_stance": np.linspace(-2.0, 0.3, 4)}
    batch = jb.starts.grid(SCENE, axes, place=True).batch(LABELLING, 0, 20)
    ours, gait = (jb.dynamics.feet(SCENE, state)[1] for state in (batch.states, jb.seed_state()))
    np.testing.assert_allclose(ours.penetration, gait.penetration, atol=1e-15)
    np.testing.assert_allclose(ours.penetration_rate, gait.penetration_rate, atol=1e-13)
    np.testing.assert_allclose(ours.slip_speed, gait.slip_speed, atol=1e-13)
    # What is named stays as it was asked for.
    named = jb.starts.grid(SCENE, {"theta_stance": [0.0], "hip_vx": [0.7]}, place=True)
    assert float(named.batch(LABELLING, 0, 1).states.hip_vx[0]) == 0.7


def test_a_function_completes_the_starts_of_each_scene():
    def mirrored(scene, states):
        return states._replace(theta_1=-states.theta_2, hip_vx=10.0 * scene.ground.slope)

    axes = {"theta_stance": [0.1, 0.2], "slope": [0.01, 0.03]}
    states = jb.starts.grid(SCENE, axes, follow=mirrored).batch(LABELLING, 0, 4).states
    np.testing.assert_array_equal(states.theta_1, [-0.1, -0.1, -0.2, -0.2])
    np.testing.assert_allclose(states.hip_vx, [0.1, 0.3, 0.1, 0.3])


@given(st.sampled_from(jb.starts.SAMPLINGS), st.integers(0, 2**31), st.lists(st.integers(0, 99)))
@settings(max_examples=20, deadline=None)
def test_a_sample_is_the_same_whichever_chunk_it_is_made_in(method, seed, cuts):
    starts = jb.starts.sample(SCENE, BOUNDS, 100, method=method, seed=seed)
    whole = starts.batch(LABELLING, 0, 100)
    edges = [0, *sorted(set(cuts) - {0}), 100]
    parts = [starts.batch(LABELLING, a, b) for a, b in itertools.pairwise(edges)]
    for name, (low, high) in BOUNDS.items():
        joined = np.concatenate([part.columns[name] for part in parts])
        np.testing.assert_array_equal(joined, whole.columns[name])
        assert np.all((joined >= low) & (joined <= high))
    some = np.array(sorted(set(cuts)), dtype=int)
    same(starts.at(LABELLING, some).states, type(whole.states)(*[x[some] for x in whole.states]))
    other = jb.starts.sample(SCENE, BOUNDS, 100, method=method, seed=seed + 1).batch(
        LABELLING, 0, 100
    )
    assert not np.array_equal(other.columns["hip_vx"], whole.columns["hip_vx"])


@pytest.mark.parametrize("method", jb.starts.SAMPLINGS)
def test_samples_fill_their_bounds(method):
    batch = jb.starts.sample(SCENE, BOUNDS, 256, method=method).batch(LABELLING, 0, 256)
    for name, (low, high) in BOUNDS.items():
        column = batch.columns[name]
        assert column.min() < low + 0.02 * (high - low)
        assert high - 0.02 * (high - low) < column.max()
    leaves = batch.states.theta_2, batch.states.omega_2, batch.states.hip_vx
    for leaf, name in zip(leaves, BOUNDS, strict=True):
        np.testing.assert_array_equal(leaf, batch.columns[name])


def test_low_discrepancy_samples_fill_every_slice():
    numbers = np.arange(64)
    for method in ("sobol", "latin-hypercube"):
        drawn = sequence_points(method, 3, 64, 5, numbers)
        for column in drawn.T:
            assert sorted(np.floor(64 * column).astype(int)) == list(range(64))
    pairs = np.floor(8 * sequence_points("sobol", 2, 64, 5, numbers)).astype(int)
    assert len({tuple(pair) for pair in pairs}) == 64


def test_given_starts_are_told_apart_by_all_their_numbers():
    state = jb.State(*[np.full(1000, float(leaf)) for leaf in jb.seed_state()])
    other = state._replace(hip_z=np.where(np.arange(1000) == 777, 0.4, state.hip_z))
    first, second = (
        jb.starts.GivenStarts(state).described(),
        jb.starts.GivenStarts(other).described(),
    )
    assert first != second
    assert len(str(first)) < 200
    assert jb.starts.GivenStarts(state).described() == first


def test_states_beyond_a_stop_are_seen_one_by_one():
    """Shanks may be bent back, and stretched as far as their thighs."""
    shank = np.array([-0.3, -0.2, -0.1])
    states = type(HELD)(*[np.full(3, float(value)) for value in HELD])
    found = jb.hybrid.Rolling().lies_beyond(KNEED, states._replace(theta_shank_1=shank))
    np.testing.assert_array_equal(found, shank > ANGLES["theta_thigh_1"])
    turned = jb.State(*[np.array([3.0])] * 8)
    assert not jb.hybrid.Walking().lies_beyond(SCENE, turned).any()


def test_a_held_knee_of_a_start_turns_as_the_thigh_that_an_axis_names():
    """By as much as it was off the thigh; all others stay the base's, and so does the mode."""
    angles, rates = np.array([0.1, 0.2, 0.25]), np.array([-1.0, -1.3])
    axes = {"theta_thigh_2": angles, "omega_thigh_2": rates}
    batch = jb.starts.grid(KNEED, axes, place=True, base=HELD).batch(gaitless(KNEED, HELD), 0, 6)
    expected = {name: np.full(6, float(value)) for name, value in HELD._asdict().items()}
    for body in ("thigh_2", "shank_2"):
        expected |= {f"theta_{body}": np.repeat(angles, 2), f"omega_{body}": np.tile(rates, 3)}
    for name, value in batch.states._asdict().items():
        np.testing.assert_allclose(value, expected[name], rtol=0.0, atol=1e-15, err_msg=name)


def test_what_is_held_moves_with_what_holds_it():
    """A held knee turns as its thigh does, in angle and rate; nothing moves the mode."""
    names = recurring_names(HELD)
    scales = np.arange(1.0, 1.0 + len(names))
    found = admissible_directions(KNEED, HELD, scales)
    assert found.shape == (9, 6)
    np.testing.assert_allclose(found.T @ found, np.eye(6), atol=1e-14)
    moves = dict(zip(names, found * scales[:, None], strict=True))
    for kind in ("theta", "omega"):
        np.testing.assert_allclose(moves[f"{kind}_shank_2"], moves[f"{kind}_thigh_2"], atol=1e-13)
    assert not np.allclose(moves["theta_shank_1"], moves["theta_thigh_1"])
    left_out = set(names) - set(independent_names(KNEED, HELD))
    assert left_out == {"theta_shank_2", "omega_shank_2", "mode"}
