"""Walks and gaits through modes, their derivatives against differences."""

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.models import hsu_chen


@pytest.fixture(scope="module")
def gait():
    return jb.find_gait(hsu_chen(), parameters=("slope", "epsilon", "J_shank"), accuracy="tight")


@pytest.mark.slow
def test_walks_go_through_the_modes(gait):
    """Each step has a phase with a bent knee and one with both straight."""
    walk = jb.simulate(hsu_chen(), gait.measures.state, footsteps=2, accuracy="tight")
    bent, straight = ("shank_2", "shank_2 held"), ("shank_2", "shank_1 held", "shank_2 held")
    assert walk.modes == (bent, straight, bent, straight, bent)
    assert np.sum(walk.mode_durations) == pytest.approx(float(walk.t[-1]), abs=1e-15)


@pytest.mark.slow
def test_multipliers_are_as_many_whatever_is_held(gait):
    """Both legs are straight where a cycle begins: the knees' angles, rates and the mode have 0."""
    assert gait.multipliers.shape == gait.multiplier_errors.shape == (8,)
    assert gait.directions.shape == (9, 8)
    assert np.abs(gait.multipliers[2]) > 0.1
    np.testing.assert_allclose(gait.multipliers[3:], 0.0, atol=1e-9)


@pytest.mark.nightly
@pytest.mark.parametrize("derivative", [jax.grad, jax.jacfwd])
def test_derivatives_go_through_the_modes(gait, derivative):
    """dt/dω of two footsteps by differences."""
    scene, state = hsu_chen(), gait.measures.state

    def lasts(rate):
        start = state._replace(omega_thigh_2=rate, omega_shank_2=rate)
        return jb.simulate(scene, start, footsteps=2, accuracy="tight").t[-1]

    rate, h = float(state.omega_thigh_2), 1e-5
    expected = (float(lasts(rate + h)) - float(lasts(rate - h))) / (2.0 * h)
    assert float(derivative(lasts)(rate)) == pytest.approx(expected, rel=1e-6)


_CENTRAL = (-1.0, 1.0), (-0.5, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "h"), [("slope", 1e-5), ("epsilon", 1e-5), ("J_shank", 1e-7)])
def test_sensitivities_are_differences_of_gaits(gait, name, h):
    """Those of the stop's limit move what is held where a cycle begins, too."""
    scene, place = hsu_chen(), gait.parameters.index(name)
    value, found = float(jb.parameter_values(scene)[name]), []
    # An inertia that is zero may not be less.
    shares, weights = ((1.0, 2.0, 3.0), (-2.5, 4.0, -1.5)) if name == "J_shank" else _CENTRAL
    for share in shares:
        changed = jb.with_parameters(scene, {name: value + share * h})
        near = jb.find_gait(
            changed,
            gait.measures.state,
            parameters=(),
            radius_sensitivities=False,
            accuracy="tight",
        )
        found.append([float(near.measures.period), float(near.measures.spectral_radius)])
    expected = np.array(weights) @ found / h
    told = gait.sensitivities.period[place], gait.sensitivities.spectral_radius[place]
    np.testing.assert_allclose(np.array(told), expected, rtol=1e-5)
    off = np.abs(np.array(told[1]) - expected[1])
    assert off < 2.0 * float(gait.sensitivity_errors.spectral_radius[place]) + 1e-6 * abs(told[1])


@pytest.mark.nightly
def test_both_engines_walk_through_the_same_modes(gait):
    walks = [
        jb.simulate(hsu_chen(), gait.measures.state, footsteps=2, save=jb.HeelStrike(), engine=name)
        for name in ("lanes", "xla")
    ]
    assert walks[0].modes == walks[1].modes
    np.testing.assert_allclose(*[walk.mode_durations for walk in walks], atol=1e-10)
    np.testing.assert_allclose(*[np.array(walk.final) for walk in walks], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", ["draft", "tight"])
def test_what_the_knees_take_closes_the_books(gait, accuracy):
    """Gravity's work is what heel strikes and stops take, the same in each footstep of a gait."""
    scene = hsu_chen()
    walk = jb.rigid_walk(scene, gait.measures.state, footsteps=3, max_arrivals=3, accuracy=accuracy)
    books = jb.measure.rigid_ledger(scene, walk)
    np.testing.assert_allclose(books.residual, 0.0, atol=1e-9)
    rtol = dict(draft=1e-3, tight=1e-6)[accuracy]
    np.testing.assert_allclose(books.stop_loss, books.stop_loss[0], rtol=rtol)
    assert 0.0 < books.stop_loss[0] < books.impact_loss[0] < books.gravity_work[0]


@pytest.mark.slow
def test_labels_of_modes_are_how_walks_end(gait):
    """Where an axis turns a thigh whose knee is held the shank follows; a bent back knee fails."""
    scene = hsu_chen()
    labelling = jb.labelling(scene, guess=gait.measures.state, footsteps=30)
    axes = {
        "omega_thigh_2": np.linspace(-2.0, -0.3, 4),
        "theta_thigh_2": np.linspace(0.1, 0.35, 4),
        "theta_thigh_1": np.array([-0.3, -0.2]),
    }
    states = jb.starts.grid(scene, axes).at(labelling, np.arange(32)).states
    np.testing.assert_allclose(states.theta_shank_2, states.theta_thigh_2, atol=1e-15)
    passed = np.isnan(np.asarray(states.mode))
    np.testing.assert_array_equal(passed, np.arange(32) % 2 == 0)
    found = labelling(states)
    assert set(found.label[passed]) == {int(jb.Ending.SOLVER_FAILED)}
    assert len(set(found.label[~passed])) > 2
    for k in np.flatnonzero(~passed)[::3]:
        start = type(states)(*[float(np.asarray(leaf)[k]) for leaf in states])
        walk = jb.rigid_walk(scene, start, footsteps=30)
        assert int(found.label[k]) == int(walk.outcome), k


@pytest.mark.slow
def test_a_leg_that_collapses_falls_to_the_side_that_its_walk_tells(gait):
    """Hip and foot are nearly in line then, and a step later the hip is on the other side."""
    scene = hsu_chen()
    angles = {
        "theta_thigh_1": (-0.27, -0.16),
        "theta_shank_1": (-0.30, -0.275),
        "theta_thigh_2": (0.26, 0.29),
        "theta_shank_2": (0.17, 0.2),
    }
    labelling = jb.labelling(scene, guess=gait.measures.state)
    states = jb.starts.sample(scene, angles, 24).at(labelling, np.arange(24)).states
    found = labelling(states)
    starts = (type(states)(*[float(np.asarray(leaf)[k]) for leaf in states]) for k in range(24))
    endings = [int(jb.rigid_walk(scene, start, footsteps=30).outcome) for start in starts]
    np.testing.assert_array_equal(found.label, endings)
    assert set(endings) == {int(jb.Ending.FELL_FORWARD), int(jb.Ending.FELL_BACK)}


def test_gaits_of_modes_are_not_xlas():
    with pytest.raises(jb.ArgumentError, match=r"engine = 'xla' is not allowed"):
        jb.find_gait(hsu_chen(), engine="xla")
