"""Results and starts that are the same, against those whose scene or whole turns differ."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import scene_of

SCENE, START = jb.seed_scene(), jb.seed_state()
RIGID, ROLLING = jb.ladder()["rigid"], jb.dynamics.rigid_state(START)
OTHERS = {
    "a number": jb.with_parameters(SCENE, {"xi": 1000.01}),
    "a sign": jb.with_parameters(SCENE, {"slope": -0.02}),
    "a rule": dataclasses.replace(SCENE, clearance=jb.laws.AlwaysTouching()),
    "a kind": RIGID,
    "a method": jb.RedundantScene(SCENE),
}
TAKES = {
    "footsteps": jb.footsteps,
    "energy_ledger": jb.measure.energy_ledger,
    "cost_of_transport": jb.measure.cost_of_transport,
    "trajectory_dataset": jb.measure.trajectory_dataset,
    "view": jb.plot.view,
    "gait_strobe": jb.plot.gait_strobe,
    "animate": jb.plot.animate,
    "contact_forces": jb.plot.contact_forces,
    "penetrations": jb.plot.penetrations,
    "leg_angles": jb.plot.leg_angles,
    "phase_portrait": jb.plot.phase_portrait,
}


@pytest.fixture(scope="module")
def walk():
    return jb.simulate(SCENE, START, duration=0.02, accuracy="draft")


@pytest.mark.parametrize("name", TAKES)
@pytest.mark.parametrize("other", OTHERS)
def test_a_walk_of_another_scene_is_refused(walk, name, other):
    with pytest.raises(
        jb.ArgumentError, match=r"simulated with another|it must be a (Scene or|Rigid|Redundant)"
    ):
        TAKES[name](OTHERS[other], walk)


def test_a_rigid_walk_of_another_scene_is_refused():
    rolled = jb.rigid_walk(RIGID, ROLLING, footsteps=2, max_arrivals=2)
    other = jb.with_parameters(RIGID, {"hip_mass": 1e-6})
    for take in (jb.measure.rigid_ledger, jb.measure.cost_of_transport):
        assert np.isfinite(take(RIGID, rolled)[0]).all()
        with pytest.raises(jb.ArgumentError, match="the walk was simulated with another one"):
            take(other, rolled)


def test_the_key_of_a_scene_is_the_same_however_it_is_computed(walk):
    def key_at(stiffness):
        scene = jb.with_parameters(SCENE, {"K": stiffness})
        return jb.simulate(scene, START, duration=1e-3, save="end").scene_key

    many = jax.vmap(key_at)(jnp.asarray([1e6, 2e6]))
    np.testing.assert_allclose(many, [walk.scene_key, key_at(2e6)], rtol=1e-14)
    assert abs(float(many[0] - many[1])) > 1e-9
    assert jax.grad(key_at)(1e6) == 0.0
    # What rounding alone makes another scene is none.
    near = jb.with_parameters(SCENE, {"m": 1.0 + 1e-15})
    assert jb.measure.energy_ledger(near, walk).gravity_work == pytest.approx(
        jb.measure.energy_ledger(SCENE, walk).gravity_work
    )


def test_whole_turns_stay_where_they_wind_something_up():
    legs = {"leg_1": scene_of("unequal"), "1": SCENE}
    spring = jb.Spring({"1": 1, "2": -1}, stiffness=1.0)
    sprung = jb.Mechanism(**SCENE.mechanism.arguments() | {"joints": (spring,)})
    legs["sprung"] = dataclasses.replace(SCENE, walker=sprung)
    for name, scene in legs.items():
        angle = "theta_1" if name == "sprung" else f"theta_{name}"
        found = getattr(
            jb.Simulation.prepare(scene, scene.state(**{angle: 7.0}), duration=1.0).state, angle
        )
        assert float(found) == pytest.approx(7.0 if name == "sprung" else 7.0 - 2.0 * np.pi)


@pytest.mark.parametrize("leg", ["theta_1", "theta_2"])
@pytest.mark.parametrize("turns", [1, -3])
def test_whole_turns_are_the_same_start(leg, turns):
    def turned(state):
        return state._replace(**{leg: getattr(state, leg) + 2.0 * np.pi * turns})

    def walked(state):
        return jb.rigid_walk(RIGID, state, footsteps=3)

    one, other = walked(ROLLING), walked(turned(ROLLING))
    assert other.outcome is one.outcome
    assert int(other.arrivals.total) == 3
    np.testing.assert_allclose(other.final, one.final, atol=1e-9)
    traced = jax.vmap(walked)(jax.tree.map(jnp.atleast_1d, turned(ROLLING)))
    np.testing.assert_allclose([leaf[0, -1] for leaf in traced.state], one.final, atol=1e-9)

    def arrived(state):
        return jb.simulate(SCENE, state, duration=0.7, save=jb.MidStance(), accuracy="draft")

    one, other = arrived(START), arrived(turned(START))
    assert int(one.arrivals.total) == int(other.arrivals.total) == 2
    np.testing.assert_allclose(other.arrivals.t[0], one.arrivals.t[0], rtol=1e-3)
    label = jb.labelling(RIGID)
    both = jax.tree.map(lambda *leaves: np.stack(leaves), ROLLING, turned(ROLLING))
    assert len(set(label(both).label)) == 1
    back = jb.return_map(RIGID, turned(ROLLING))
    np.testing.assert_allclose(back.time, jb.return_map(RIGID, ROLLING).time, rtol=1e-9)
