"""Arrivals at sections and extremes, against the walk between its steps, by both engines."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

pytestmark = pytest.mark.slow

DURATION = 2.0


def _walk(**options):
    options = {"duration": DURATION, "accuracy": "tight", **options}
    return jb.simulate(jb.seed_scene(), jb.seed_state(), **options)


def _heights(scene, state):
    return {"hip": state.hip_z, "speeds": (state.hip_vx, state.omega_1)}


def test_heel_strikes_are_the_walks_footsteps(seed_walk):
    scene, whole = seed_walk
    expected = jb.measure.heel_strikes(scene, whole).time_s
    walk = _walk(save=jb.HeelStrike(), max_arrivals=6)
    strikes = walk.arrivals
    count = int(strikes.total)
    assert (walk.engine, count) == ("lanes", len(expected))
    np.testing.assert_allclose(strikes.t[:count], expected, atol=1e-7)
    assert np.all(np.isinf(strikes.t[count:]))
    assert walk.t.tolist() == [DURATION]
    np.testing.assert_allclose(walk.final, whole.final, atol=2e-5)
    at = whole.at(strikes.t[:count])
    np.testing.assert_allclose(np.array(strikes.state)[:, :count], np.array(at), atol=2e-5)


def test_arrivals_without_room_are_counted():
    strikes = _walk(save=jb.HeelStrike(), max_arrivals=2).arrivals
    assert strikes.t.shape == (2,)
    assert int(strikes.total) == 4


def test_mid_stances_are_the_return_maps():
    stances = _walk(save=jb.MidStance()).arrivals
    once = jb.return_map(jb.seed_scene(), jb.seed_state(), accuracy="tight")
    twice = jb.return_map(jb.seed_scene(), jb.seed_state(), footsteps=2, accuracy="tight")
    # The map exchanges the legs each time: it does not stop where the leg that stands at first
    # passes, which is an arrival of its own.
    assert float(stances.t[0]) < float(once.time)
    np.testing.assert_allclose(stances.state.theta_2[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(stances.t[1:3], [once.time, twice.time], atol=1e-7)
    # Its first one names its legs the other way round, the second one as the start.
    np.testing.assert_allclose(stances.state.theta_2[1], once.state.theta_1, atol=1e-7)
    np.testing.assert_allclose(stances.state.theta_1[2], twice.state.theta_1, atol=1e-7)


def test_any_function_is_a_section():
    falls = jb.Section(lambda scene, y: -y.hip_vz, lambda scene, y: jnp.asarray(True))
    found = _walk(save=falls, duration=0.5).arrivals
    count = int(found.total)
    assert count >= 1
    np.testing.assert_allclose(found.state.hip_vz[:count], 0.0, atol=1e-10)


def test_extremes_are_those_of_the_steps(seed_walk):
    _, whole = seed_walk
    walk = _walk(save="end", extremes=_heights)
    for found, reduce in ((walk.lowest, np.min), (walk.highest, np.max)):
        assert found["hip"] == pytest.approx(float(reduce(whole.state.hip_z)), abs=1e-6)
        assert found["speeds"][0] == pytest.approx(float(reduce(whole.state.hip_vx)), abs=1e-4)


@pytest.mark.nightly
def test_extremes_by_both_engines_agree():
    """To the tolerance: rounding decides on the steps, and extremes are taken at their ends."""
    lanes, xla = (
        jax.tree.leaves((walk.lowest, walk.highest))
        for engine in ("lanes", "xla")
        for walk in [_walk(save="end", footsteps=2, extremes=_heights, engine=engine)]
    )
    np.testing.assert_allclose(lanes, xla, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize(
    "options",
    [
        dict(engine="lanes"),
        dict(solver="euler", dt=1e-6, duration=0.05, max_solver_steps=1 << 16),
    ],
    ids=["lanes", "dt"],
)
def test_extremes_beside_every_step(options):
    walk = _walk(extremes=_heights, **options)
    assert walk.outcome is jb.Ending.WALKING
    for found, reduce in ((walk.lowest, np.min), (walk.highest, np.max)):
        assert float(found["hip"]) == float(reduce(walk.state.hip_z))
        assert float(found["speeds"][1]) == float(reduce(walk.state.omega_1))


def test_many_give_what_each_gives_alone():
    speeds = jnp.array([0.1, 0.35, 0.38, 0.4, 0.9])

    def one(speed):
        state = jb.seed_state()._replace(hip_vx=speed)
        how = dict(duration=1.0, save=jb.HeelStrike(), max_arrivals=4, extremes=_heights)
        walk = jb.simulate(jb.seed_scene(), state, **how)
        return walk.t, walk.state, walk.arrivals, walk.lowest, walk.highest, walk.ending

    together = jax.jit(jax.vmap(one))(speeds)
    for k, speed in enumerate(speeds):
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(one(speed)), strict=True):
            np.testing.assert_array_equal(a[k], b)


@pytest.mark.nightly
def test_the_loop_of_xla_arrives_where_lanes_do():
    lanes, xla = (_walk(save=jb.HeelStrike(), max_arrivals=6, engine=e) for e in ("lanes", "xla"))
    assert xla.engine == "xla"
    count = int(lanes.arrivals.total)
    assert int(xla.arrivals.total) == count >= 2
    np.testing.assert_allclose(xla.arrivals.t[:count], lanes.arrivals.t[:count], rtol=1e-5)
    assert np.all(np.isinf(xla.arrivals.t[count:]))
    np.testing.assert_allclose(
        xla.arrivals.state.theta_1[:count], lanes.arrivals.state.theta_1[:count], atol=1e-5
    )
