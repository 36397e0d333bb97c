"""Optima of mechanisms: their objectives against the seed's walker, walks and other designs."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.gait._search_starts import default_guess
from jaxbiped.optimise._objectives import check_objective
from tests.mechanisms import SEED_WITH_TORSO, scene_of, seed_walker
from tests.optimise.evaluations import evaluated

STANCE = jb.laws.StanceRotation()
UNLIKE = dataclasses.replace(jb.seed_scene(), walker=seed_walker(first=1.02))
"""Its cycle is a stride, near two of the seed's steps."""
KNEED = dataclasses.replace(
    jb.seed_scene(slope=0.0456),
    walker=jb.Kneed(
        m_thigh=0.2, J_thigh=5.8e-4, l_thigh=0.184, d_thigh=0.080,
        m_shank=0.124, J_shank=6.9e-4, l_shank=0.216, d_shank=0.096, w_shank=-0.004,
        r=0.08, hip_mass=1.352, epsilon=0.2, stop=jb.laws.RistowSchafer(K=300.0, c=3000.0, n=1.0),
    ),
    clearance=jb.laws.AlwaysTouching(),
)  # fmt: skip
BENT = dict(
    theta_thigh_1=0.14, theta_shank_1=-0.20, omega_thigh_1=3.4, omega_shank_1=1.7,
    theta_thigh_2=-0.086, theta_shank_2=0.118, omega_thigh_2=-0.88, omega_shank_2=-0.88,
    standing="shank_2",
)  # fmt: skip
SAME = {"1+2.mass": "m", "1+2.inertia": "J", "1+2.centre": "d", "slope": "slope", "K": "K"}


def test_weights_are_those_of_all_pieces():
    scene = scene_of("kneed")
    weight, _, slopes, _ = jb.optimise.OBJECTIVES["weight"].measured(scene, None)
    names, g = jb.parameter_names(scene), float(scene.ground.g)
    assert float(weight) == pytest.approx((1.352 + 2 * 0.2 + 2 * 0.124) * g, rel=1e-14)
    told = dict(zip(names, np.asarray(slopes).tolist(), strict=True))
    known = {"hip.mass": g, "thigh.mass": 2 * g, "shank.mass": 2 * g, "g": float(weight) / g}
    assert {name: told[name] for name in known} == pytest.approx(known, rel=1e-14)
    assert all(value == 0.0 for name, value in told.items() if name not in known)


@pytest.mark.parametrize("name", ["floor_sensitivity", "clearance_sensitivity"])
def test_steps_in_the_ground_are_of_mirrored_walkers(name):
    with pytest.raises(jb.ArgumentError, match="mirrored walkers alone"):
        check_objective(name, scene_of("unequal", clearance=STANCE))
    check_objective(name, scene_of("torso", clearance=STANCE))


def test_footsteps_are_whole_cycles():
    scene = scene_of("unequal", clearance=STANCE)
    vary = {"leg_1.mass": (0.9, 1.1)}
    with pytest.raises(jb.ArgumentError, match="footsteps = 1 is not allowed"):
        jb.optimise_gait(scene, vary=vary, maximise="speed", footsteps=1)
    with pytest.raises(jb.ArgumentError, match="footsteps = 3 is not allowed"):
        jb.continue_gait(scene, "leg_1.mass", bounds=(0.9, 1.1), footsteps=3)


def test_motors_are_bounded_as_actuators_are():
    motor = jb.Motor({"leg_1": 1, "leg_2": -1}, jb.actuation.Constant(0.01), by="side")
    with pytest.raises(jb.ArgumentError, match="no motors"):
        check_objective("motor_work", scene_of("unequal"))
    driven = jb.Mechanism(**scene_of("unequal").walker.arguments() | {"joints": (motor,)})
    check_objective("motor_work", scene_of("unequal", walker=driven))


@pytest.mark.nightly
def test_objectives_of_the_seed_as_a_mechanism_are_the_seeds():
    seed, names = jb.seed_scene(slope=0.02), ("impact_loss", "cost_of_transport", "spectral_radius")
    told = []
    for scene in (seed, dataclasses.replace(seed, walker=seed_walker(), clearance=STANCE)):
        gait = jb.find_gait(scene, radius_sensitivities=False)
        told.append((jb.parameter_names(scene), evaluated(scene, gait, names)))
    (own, seeds), (others, found) = told
    for name in names:
        bar = seeds.errors[name] + 1e-9
        assert abs(found.values[name] - seeds.values[name]) < bar
        for other, seeds_own in SAME.items():
            k, j = others.index(other), own.index(seeds_own)
            off = abs(found.slopes[name][k] - seeds.slopes[name][j])
            bar = found.slope_errors[name][k] + seeds.slope_errors[name][j]
            assert off <= bar + 1e-7 * abs(seeds.slopes[name][j])


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("scene", "guess"),
    [
        pytest.param(SEED_WITH_TORSO, None, id="torso"),
        pytest.param(UNLIKE, None, id="unlike"),
        pytest.param(KNEED, BENT, id="kneed"),
    ],
)
def test_what_is_lost_is_the_slopes_sine(scene, guess):
    """The cost of transport is what contact, friction, dampers and stops lose."""
    guess = default_guess(scene) if guess is None else scene.state(**guess)
    gait = jb.find_gait(scene, guess, radius_sensitivities=False)
    known = evaluated(scene, gait, ("cost_of_transport",))
    name, slope = "cost_of_transport", float(scene.ground.slope)
    assert known.values[name] == pytest.approx(np.sin(slope), rel=1e-6)
    names = jb.parameter_names(scene)
    exact = np.where(np.array(names) == "slope", np.cos(slope), 0.0)
    sizes = [abs(float(value)) for value in jb.parameter_values(scene).values()]
    assert np.all(np.abs(known.slopes[name] - exact) * sizes < 1e-4 * np.sin(slope))


@pytest.mark.slow
def test_a_faster_torso():
    gait = jb.find_gait(SEED_WITH_TORSO, radius_sensitivities=False)
    vary = {"torso.spring.stiffness": (6.0, 12.0), "torso.mass": (0.4, 0.6)}
    best = jb.optimise_gait(SEED_WITH_TORSO, vary=vary, maximise="speed", guess=gait)
    assert best.outcome is jb.optimise.Outcome.CONVERGED
    again = jb.find_gait(best.scene, gait.measures.state, radius_sensitivities=False)
    assert best.objective == pytest.approx(float(again.measures.speed), rel=1e-6)
    assert best.objective > float(gait.measures.speed)
