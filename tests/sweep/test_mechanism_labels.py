"""Labels and starts of mechanisms, against walks of `simulate` one by one."""

import dataclasses

import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import FEET, LEGS, PAIR, WALKERS, scene_of, start_of
from tests.sweep.walkers import gaitless

STANCE = jb.laws.StanceRotation()
AXES = {
    "torso": ({"theta_leg_2": (0.0, 0.3), "omega_leg_2": (-2.5, -0.4)}, STANCE),
    "five": ({"theta_thigh_2": (0.0, 0.4), "pelvis_vx": (0.0, 1.0)}, None),
}
SEED = jb.seed_scene(slope=0.03)


def _walker_on_seeds_ground(walker):
    return dataclasses.replace(SEED, walker=walker, clearance=STANCE)


def _row(states, k):
    return type(states)(*[float(np.asarray(leaf)[k]) for leaf in states])


def _check_one_by_one(labelling, states, found, numbers):
    """The label of each start is how its walk ends, and when."""
    for k in numbers:
        walk = jb.simulate(
            labelling.scene, _row(states, k), footsteps=30, save="end", engine="lanes"
        )
        assert int(found.label[k]) == int(walk.outcome), k
        if walk.outcome is not jb.Ending.WALKING:
            assert found.time[k] == pytest.approx(float(walk.t[-1]), rel=0.1, abs=0.02)


@pytest.mark.parametrize("name", ["torso", pytest.param("five", marks=pytest.mark.slow)])
def test_labels_are_how_walks_end(name):
    bounds, clearance = AXES[name]
    scene = scene_of(name, clearance=clearance)
    labelling = gaitless(scene, start_of(name, scene), footsteps=30, accuracy="draft")
    axes = {each: np.linspace(*ends, 4) for each, ends in bounds.items()}
    states = jb.starts.grid(scene, axes).batch(labelling, 0, 16).states
    found = labelling(states)
    assert len(np.unique(found.label)) > (name != "five")
    _check_one_by_one(labelling, states, found, range(16))


@pytest.mark.slow
def test_a_torsos_gait_draws_in_what_walks():
    """Starts that come to the gait walk, and their last arrivals are the gait's own."""
    scene = _walker_on_seeds_ground(WALKERS["torso"])
    near = scene.state(
        theta_leg_1=0.1516, theta_torso=0.0787, hip_z=0.39927, hip_vx=0.3244, hip_vz=-0.0004,
        omega_leg_1=2.5587, omega_leg_2=-0.811, omega_torso=0.9314,
    )  # fmt: skip
    labelling = jb.labelling(scene, guess=near)
    ((gait,),) = labelling.family.rows
    assert gait.radius > 1e-3
    axes = {"theta_leg_2": np.linspace(0.05, 0.25, 4), "omega_leg_2": np.linspace(-1.8, -1.0, 4)}
    starts = jb.starts.grid(scene, axes)
    found = jb.sweep(labelling, starts, look_for_gaits=False)
    states = starts.batch(labelling, 0, 16).states
    flat = labelling(states)
    np.testing.assert_array_equal(found.label.values.ravel(), flat.label)
    walking = flat.label == int(jb.basins.Label.WALKING)
    assert 0 < walking.sum() < 16
    assert set(flat.cycle_footsteps[walking]) == {1}
    assert np.all(gait.distance(flat.final[walking]) <= gait.radius)
    _check_one_by_one(labelling, states, flat, range(0, 16, 3))


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*stride")
def test_cycles_of_unlike_legs_are_strides():
    """Of two footsteps; near equal legs they last twice a step, and draw in what walks."""
    even = _walker_on_seeds_ground(jb.Mechanism(bodies=LEGS, feet=FEET, mirror=PAIR))
    step = jb.find_gait(even, parameters=())
    uneven = jb.with_parameters(even, {"leg_1.mass": 1.02})
    labelling = jb.labelling(uneven, guess=step.measures.state)
    ((gait,),) = labelling.family.rows
    assert gait.cycle_footsteps == 2
    assert gait.duration == pytest.approx(2.0 * float(step.measures.period), rel=0.02)
    axes = {"theta_leg_2": np.linspace(0.0, 0.2, 4), "omega_leg_2": np.linspace(-1.8, -1.0, 4)}
    states = jb.starts.grid(uneven, axes).batch(labelling, 0, 16).states
    found = labelling(states)
    walking = found.label == int(jb.basins.Label.WALKING)
    assert walking.any()
    assert set(found.cycle_footsteps[walking]) == {2}
    _check_one_by_one(labelling, states, found, range(0, 16, 3))


@pytest.mark.parametrize("name", WALKERS)
def test_starts_are_placed_on_the_standing_leg(name):
    """As deep, and as slowly slipping, as the base; the rest is the base's own."""
    scene = scene_of(name)
    structure = scene.mechanism.structure
    base = start_of(name, scene)
    labelling = gaitless(scene, base, accuracy="draft")
    leg = structure.legs[structure.stance_leg]
    body = structure.bodies[structure.chains[structure.feet[-1]][0]]
    axes = {f"theta_{body}": [0.1, 0.2], f"omega_{body}": [-1.0, 0.0]}
    told = scene.state(theta_leg_1=0.1) if "leg_1" in structure.bodies else base
    for given in (None, told):
        states = jb.starts.grid(scene, axes, base=given).batch(labelling, 0, 4).states
        first = base if given is None else given
        np.testing.assert_array_equal(getattr(states, f"theta_{body}"), [0.1, 0.1, 0.2, 0.2])
        others = set(structure.coordinates[2:]) - {f"theta_{body}"}
        for other in others:
            np.testing.assert_array_equal(getattr(states, other), np.full(4, getattr(first, other)))
        for k in range(4):
            ours, theirs = (_lowest(scene, state, leg) for state in (_row(states, k), first))
            np.testing.assert_allclose(ours, theirs, atol=1e-12)


def _lowest(scene, state, leg):
    """Depth, its rate and slip speed of the lowest foot of a leg."""
    structure = scene.mechanism.structure
    feet = jb.dynamics.feet(scene, type(state)(*map(np.asarray, state)))
    own = [feet[k] for k in structure.feet_of_leg[structure.legs.index(leg)]]
    foot = max(own, key=lambda each: float(each.penetration))
    return [float(each) for each in (foot.penetration, foot.penetration_rate, foot.slip_speed)]


def test_two_legs_keep_their_old_names():
    seed = jb.seed_scene()
    labelling = gaitless(seed, jb.seed_state(), accuracy="draft")
    by_role = jb.starts.grid(seed, {"theta_stance": [0.1], "omega_swing": [0.2]}, place=True)
    by_name = jb.starts.grid(seed, {"theta_2": [0.1], "omega_1": [0.2]})
    for one, other in zip(
        by_role.batch(labelling, 0, 1).states, by_name.batch(labelling, 0, 1).states, strict=True
    ):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(jb.ArgumentError, match="theta_stance and theta_2 are not allowed together"):
        jb.starts.grid(seed, {"theta_stance": [0.1], "theta_2": [0.1]})
    mirrored = jb.Mechanism(
        bodies=[dataclasses.replace(body, name=body.name[-1]) for body in LEGS],
        feet=[dataclasses.replace(foot, body=foot.body[-1], leg=None) for foot in FEET],
        mirror=(("2", "1"),),
    )
    scene = dataclasses.replace(seed, walker=mirrored)
    starts = jb.starts.grid(scene, {"theta_stance": [0.1]})
    labelling = gaitless(scene, jb.seed_state(), accuracy="draft")
    assert starts.batch(labelling, 0, 1).states.theta_1.tolist() == [0.1]


def test_names_of_other_walkers_are_those_of_their_states():
    scene = scene_of("kneed")
    names = jb.starts.coordinate_names(scene)
    assert names[:2] == ("hip_z", "theta_thigh_1")
    assert "shank.stop.K" in names
    assert "theta_stance" not in names
    quantities = jb.starts.coordinate_quantities(scene)
    assert quantities["omega_shank_1"].unit == "rad/s"
    assert quantities["shank.stop.K"].unit == "N m/rad^n"
    for wrong in ({"theta_stance": [0.1]}, {"hip_x": [0.1]}):
        with pytest.raises(jb.ArgumentError, match="coordinate = "):
            jb.starts.grid(scene, wrong)
    with pytest.raises(jb.ArgumentError, match="base has the scalars"):
        jb.starts.grid(scene, {"theta_thigh_1": [0.1]}, base=jb.seed_state())
    many = scene.state(theta_thigh_1=[0.1, 0.2])
    with pytest.raises(jb.ArgumentError, match="give one state"):
        jb.starts.grid(scene, {"theta_thigh_1": [0.1]}, base=many)


def test_turns_of_a_body_count_where_something_acts_at_joints():
    """Two bare legs are the same a turn further; a knee's stop is passed by a whole turn."""
    legs = _walker_on_seeds_ground(jb.Mechanism(bodies=LEGS, feet=FEET, mirror=PAIR))
    for scene, name, alike in (
        (legs, "theta_leg_1", True),
        (scene_of("torso", clearance=STANCE), "theta_torso", False),
    ):
        near = scene.state(theta_leg_1=-0.25, theta_leg_2=0.17, omega_leg_2=-1.3, standing="leg_2")
        turned = near._replace(**{name: getattr(near, name) + 2.0 * np.pi})
        both = type(near)(*[np.array([a, b], float) for a, b in zip(near, turned, strict=True)])
        found = gaitless(scene, near, accuracy="draft")(both)
        assert np.allclose(found.time[0], found.time[1], rtol=1e-9) == alike
        assert max(abs(x) for n, x in turned._asdict().items() if n.startswith("theta_")) > 6.0
