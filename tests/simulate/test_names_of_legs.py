"""Events of walks whose legs' names are exchanged, against roots of their continuous solutions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxbiped as jb

SCENE, STATE = jb.seed_scene(), jb.seed_state()
TWIN = jb.dynamics.exchange_legs(SCENE, STATE)
DURATION = 1.3


def _ahead(args, state):
    """The leg called 1 swings far ahead."""
    return state.theta_1 - 0.2


def _turns(args, state):
    """Rises and falls again within 2 ms, about where the first leg is at 0.25 rad."""
    return 1e-6 - (state.theta_1 - 0.25) ** 2


def _roots(walk, function):
    """Times at which a function of the state, under either naming, rises through zero."""
    times = np.linspace(0.0, DURATION, 20001)
    found = []
    for named in (lambda y: y, lambda y: jb.dynamics.exchange_legs(SCENE, y)):
        value = lambda t, named=named: float(function(SCENE, named(walk.at(t))))
        values = np.asarray(function(SCENE, named(walk.at(times))))
        rises = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
        found += [brentq(value, times[i], times[i + 1], xtol=1e-12) for i in rises]
    return np.sort(found)


def _arrivals(scene, state, section, **options):
    walk = jb.simulate(scene, state, duration=DURATION, save=section, engine="lanes", **options)
    return np.asarray(walk.arrivals.t)[: int(walk.arrivals.total)]


@pytest.mark.slow
@pytest.mark.parametrize("function", [_ahead, _turns])
def test_a_section_sees_every_rise_of_either_leg(function):
    whole = jb.simulate(SCENE, STATE, duration=DURATION, accuracy="tight", engine="lanes")
    expected = _roots(whole, function)
    assert len(expected) >= 3
    for state in (STATE, TWIN):
        for accuracy, near in (("draft", 2e-4), ("tight", 1e-6)):
            found = _arrivals(SCENE, state, jb.Section(function), accuracy=accuracy)
            np.testing.assert_allclose(found, expected, atol=near)


@pytest.mark.slow
def test_heel_strikes_of_twins_are_the_footsteps():
    how = dict(save="end", engine="lanes")
    steps = [float(jb.simulate(SCENE, STATE, footsteps=n, **how).t[-1]) for n in (1, 2)]
    for state in (STATE, TWIN):
        found = _arrivals(SCENE, state, jb.HeelStrike())
        np.testing.assert_allclose(found[:2], steps, atol=1e-3)
        np.testing.assert_allclose(found, _arrivals(SCENE, STATE, jb.HeelStrike()), atol=1e-8)
        assert len(found) == 3


@pytest.mark.slow
@pytest.mark.parametrize("section", [jb.HeelStrike(), jb.MidStance()])
def test_return_maps_of_twins_agree_and_go_on_from_the_section(section):
    def returned(state):
        return jb.return_map(SCENE, state, section=section)

    def slope(state, name):
        time = lambda w: returned(state._replace(**{name: w})).time
        return float(jax.jvp(time, (getattr(state, name),), (jnp.ones(()),))[1])

    first, second = returned(STATE), returned(TWIN)
    assert float(first.time) == float(second.time)
    np.testing.assert_array_equal(np.array(first.state), np.array(second.state))
    assert float(returned(first.state).time) == pytest.approx(0.4415, abs=2e-3)
    assert slope(TWIN, "omega_2") == pytest.approx(slope(STATE, "omega_1"), rel=1e-12)


@pytest.mark.nightly
def test_a_return_in_redundant_coordinates_is_that_of_its_twin():
    scene = jb.RedundantScene(SCENE, jb.constraints.Index1())
    first, second, plain = (
        jb.return_map(*each, section=jb.HeelStrike())
        for each in ((scene, STATE), (scene, TWIN), (SCENE, STATE))
    )
    assert float(second.time) == pytest.approx(float(first.time), rel=1e-9)
    assert float(first.time) == pytest.approx(float(plain.time), rel=1e-6)


@pytest.mark.slow
def test_a_gait_is_found_from_a_twin():
    found, expected = (
        jb.find_gait(SCENE, start, parameters=(), radius_sensitivities=False)
        for start in (TWIN, STATE)
    )
    assert float(found.measures.period) == float(expected.measures.period)
    assert int(found.evaluations) == int(expected.evaluations)
