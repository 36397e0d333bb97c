"""Waves of walks against walks that are made up, and what a relaxed walker is against its rules."""

import dataclasses

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import parameter_values
from jaxbiped.dynamics._state import recurring_names
from jaxbiped.gait import _walk_waves
from jaxbiped.gait._homotopy import homotopy_to, line_from_model
from jaxbiped.gait._walk_waves import Walks
from tests.mechanisms import FEET, LEGS, PAIR, TORSO, scene_of

LEVEL = dict(ground=jb.Ground(slope=0.0), clearance=jb.laws.StanceRotation())
PLAIN = dict(parameters=(), radius_sensitivities=False)


def made_up(target, *, reach, attempted=0):
    """Walks that get the farther the nearer their scatter is to a target; `reach` is how near all
    the way needs, `attempted` how many steps they take."""
    begun = []

    def walk(scatter, others):
        begun.append(scatter)
        off = np.linalg.norm(scatter - target, axis=1)
        counts = np.where(off < reach, 40, np.clip(6.0 - 2.0 * off, 0.0, 39.0)).astype(int)
        gone = np.arange(40) < counts[:, None]
        points = np.where(gone, off[:, None], np.nan)[..., None]
        places = np.where(gone, 0.4 * np.arange(40), np.nan)
        return Walks(counts, points, np.ones(1), places, attempted)

    return walk, begun


def waves_of(walk):
    return _walk_waves._waves(6, walk, list)


def test_waves_come_to_walks_far_from_the_first_starts():
    target = np.array([1.5, -1.0, 0.8, -0.7, 0.3, 0.2])
    walk, begun = made_up(target, reach=0.3)
    waves = list(waves_of(walk))
    assert not waves[0].settled()
    assert waves[-1].settled()
    assert len(waves) < 10
    nearest = [np.linalg.norm(each - target, axis=1).min() for each in begun]
    assert nearest[-1] < 0.3 < nearest[0]
    # They are the same each time.
    first = begun[0].copy()
    next(waves_of(walk))
    assert np.array_equal(begun[-1], first)


def test_waves_end_where_none_gets_farther():
    walk, _ = made_up(np.zeros(6), reach=0.0)
    assert 5 <= len(list(waves_of(walk))) < 24


def test_waves_that_get_farther_go_on():
    """Each walks a footstep more than the one before."""
    counts = iter(range(3, 40))

    def walk(scatter, others):
        gone = np.tile(np.arange(40) < next(counts), (len(scatter), 1))
        points = np.where(gone, 1.0 + np.arange(40) % 7, np.nan)[..., None]
        return Walks(
            gone.sum(axis=1), points, np.ones(1), np.where(gone, np.arange(40.0), np.nan), 0
        )

    assert len(list(waves_of(walk))) == _walk_waves._MOST


def test_waves_end_where_walks_take_too_many_steps():
    """As on ground so stiff that feet bounce: three waves of 15 million, but one of 50."""
    for attempted, waves in ((15_000_000, 3), (50_000_000, 1)):
        walk, _ = made_up(np.zeros(6), reach=0.0, attempted=attempted)
        assert len(list(waves_of(walk))) == waves


def test_walks_get_as_far_as_they_step_ahead_and_all_but_return():
    """Of three walks one steps on, one only chatters at the section, one ends at once."""
    steps = np.full((3, 40, 1), np.nan)
    places = np.full((3, 40), np.nan)
    steps[0, :4, 0], places[0, :4] = [0.5, 0.3, 0.2, 0.7], [0.1, 0.5, 0.9, 1.3]
    steps[1, :5, 0], places[1, :5] = 0.2, 0.1
    steps[2, :1, 0], places[2, :1] = 0.4, 0.1
    walks = Walks(np.array([4, 5, 1]), steps, np.array([2.0]), places)
    np.testing.assert_allclose(walks.progress(), [3.0 + 1.0 / 1.1, 0.0, 0.0], atol=1e-6)
    # The arrival from which a step led nearest to itself, in the state's own size.
    assert [point.tolist() for point in walks.near_returns(8)] == [[0.6]]


@pytest.mark.parametrize(("advance", "steps"), [(0.025, 39), (0.01, 0)])
def test_steps_of_a_fortieth_of_the_height_walk_and_those_of_a_hundredth_chatter(advance, steps):
    """To all that is asked of walks: how far they get, where they settle and where they return."""
    places = 0.1 + advance * np.arange(40)[None]
    walks = Walks(np.array([40]), np.full((1, 40, 1), 0.3), np.array([2.0]), places)
    assert walks.progress().tolist() == [steps + (1.0 if steps else 0.0)]
    for points in (walks.settled(), walks.near_returns(8)):
        assert [point.tolist() for point in points] == ([[0.6]] if steps else [])


def test_a_relaxed_walker_is_straight_and_passive_and_of_legs_alone():
    skew = [dataclasses.replace(foot, centre=(0.32, 0.01)) for foot in FEET]
    lean = jb.actuation.PD(kp=4.0, kd=0.4, of={"torso": 1, "normal": -1})
    walker = jb.Mechanism(
        bodies=(*LEGS, TORSO),
        feet=skew,
        joints=(
            jb.Spring({"torso": 1, "vertical": -1}, stiffness=2.0),
            jb.Motor({"torso": 1, "leg_2": -1}, lean),
        ),
        mirror=PAIR,
    )
    scene = scene_of("torso", walker=walker, **LEVEL)
    line = homotopy_to(scene)
    asked, first, last = (
        {name: float(x) for name, x in parameter_values(each).items()}
        for each in (scene, line.at(0.0), line.at(1.0))
    )
    assert last == asked | {"torso.motor.share": 1.0}
    changed = {name: first[name] for name in last if first[name] != last[name]}
    assert changed == {
        "slope": 0.02,
        "torso.mass": pytest.approx(3e-4),
        "torso.inertia": pytest.approx(1.5e-6),
        "torso.spring.stiffness": pytest.approx(2e-3),
        "torso.motor.share": pytest.approx(1e-3),
        "leg.foot.centre_ahead": 0.0,
    }


def _shape(scene):
    """Numbers of a walker and its laws in its weight, its height and g."""
    known = {name: float(x) for name, x in parameter_values(scene).items()}
    mechanism, g = scene.mechanism, known["g"]
    weight, height = float(mechanism.total_mass) * g, float(mechanism.height)
    pace = (g * height) ** 0.5
    lengths = {k: x / height for k, x in known.items() if "centre" in k or k.endswith("radius")}
    return lengths | {
        "K": known["K"] * height**1.5 / weight,
        "c": known["c"] * height * pace / weight,
        "v0": known["v0"] / pace,
        "xi": known["xi"] * pace,
        "slope": known["slope"],
        "inertia": known["thigh.inertia"] * g / weight / height**2,
        "stop": known["shank.stop.K"] / weight / height,
        "damper": known["shank.stop.c"] * pace / weight / height**2,
    }


OTHER_PLACES = {"thigh.centre": 0.3, "shank.centre": 0.1, "shank.centre_ahead": 0.02,
                "shank.at": 0.5, "shank.foot.centre": 0.22}  # fmt: skip
"""Masses and feet of a person whose joints lie elsewhere, at the same height [m]."""


@pytest.mark.parametrize("places", [{}, OTHER_PLACES])
def test_a_line_begins_at_a_model_of_the_scenes_size_and_weight(places):
    """Where nothing can be relaxed: in its own units the first walker is McGeer's with knees."""
    line = homotopy_to(jb.with_parameters(person(), places))
    model = jb.models.mcgeer(knees=True)
    wanted = _shape(dataclasses.replace(model, walker=model.mechanism))
    begun = _shape(line.first)
    assert {name: pytest.approx(x, rel=1e-12) for name, x in begun.items()} == wanted
    assert float(line.first.mechanism.total_mass) == pytest.approx(39.0)
    assert float(line.first.mechanism.height) == pytest.approx(0.9)
    assert line.first.ground.g == person().ground.g
    legs = homotopy_to(scene_of("unequal")).first.walker.pieces[:2]
    assert [float(leg.mass) for leg in legs] == pytest.approx([1.1, 1.1])
    own = homotopy_to(model)  # a walker of parameters by name is followed as a mechanism
    assert jax.tree.structure(own.first) == jax.tree.structure(own.last)
    assert line_from_model(scene_of("flat")) is line_from_model(scene_of("five")) is None


def person(size=1.0, mass=39.0, g=9.81):
    """A walker with knees of a person's proportions, on ground in proportion to its weight."""
    leg, weight = 0.9 * size, mass * g
    pace, share = (g * leg) ** 0.5, mass / 39.0
    bodies, joints = [], []
    for i in (1, 2):
        thigh, shank = f"thigh_{i}", f"shank_{i}"
        inertias = 0.1234 * share * size**2, 0.0945 * share * size**2
        own = dict(mass=8.0 * share, inertia=inertias[0], centre=0.2 * leg)
        bodies.append(jb.Body(thigh, **own))
        own = dict(mass=4.0 * share, inertia=inertias[1], centre=(0.24 * leg, -0.01 * leg))
        bodies.append(jb.Body(shank, **own, parent=thigh, at=0.46 * leg))
        law = jb.laws.RistowSchafer(K=40.0 * weight * leg, c=400.0 * weight * leg**2 / pace, n=1.0)
        joints.append(jb.Stop(shank, upper=0.2, law=law))
    walker = jb.Mechanism(
        root_mass=15.0 * share,
        bodies=bodies,
        feet=[jb.Foot(f"shank_{i}", centre=0.34 * leg, radius=0.2 * leg) for i in (1, 2)],
        joints=joints,
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
    )
    return jb.Scene(
        walker=walker,
        ground=jb.Ground(slope=0.05, g=g),
        normal=jb.laws.RistowSchafer(K=1.3e4 * weight / leg**1.5, c=4e5 * weight / leg / pace),
        friction=jb.laws.BengisuAkay(0.5, 0.4, 5e-5 * pace, 2e3 / pace),
    )


@pytest.mark.slow
def test_knees_are_found_by_continuation_at_every_size():
    """The gait of a person's, a toy's and one on the moon is the same in its own units."""
    found = {}
    for size, mass, g in ((1.0, 39.0, 9.81), (0.1, 0.05, 9.81), (1.0, 39.0, 1.62)):
        gait = jb.find_gait(person(size, mass, g), **PLAIN)
        assert gait.stable
        assert gait.found_by is jb.gait.FoundBy.CONTINUATION
        found[size, g] = float(gait.measures.period) * (g / size) ** 0.5
    first, *others = found.values()
    assert others == pytest.approx([first] * 2, rel=1e-6)


def test_a_share_multiplies_the_motors_torque():
    motor = jb.Motor({"leg_1": 1, "leg_2": -1}, jb.actuation.PD(kp=3.0, kd=0.1, target=0.5))

    def accelerations(share):
        joint = dataclasses.replace(motor, share=share)
        walker = jb.Mechanism(bodies=LEGS, feet=FEET, joints=(joint,), mirror=PAIR)
        scene = scene_of("torso", walker=walker)
        state = scene.state(theta_leg_1=0.2, theta_leg_2=-0.1, omega_leg_1=1.0, hip_z=0.398)
        return np.array(jb.dynamics.accelerations(scene, state))

    none, half, whole, plain = (accelerations(x) for x in (0.0, 0.5, 1.0, None))
    np.testing.assert_array_equal(whole, plain)
    np.testing.assert_allclose(half, 0.5 * (none + whole), rtol=1e-12, atol=1e-12)
    assert np.abs(whole - none).max() > 1.0


def light_legs(ahead):
    """Legs of a fifth of the root point's mass, their mass centres ahead of them."""
    legs = tuple(jb.Body(f"leg_{i}", mass=0.2, inertia=0.002, centre=(0.1, ahead)) for i in (1, 2))
    walker = jb.Mechanism(root_mass=1.0, bodies=legs, feet=FEET, mirror=PAIR)
    seed = jb.seed_scene()
    return jb.Scene(walker, seed.ground, seed.normal, seed.friction, jb.laws.StanceRotation())


@pytest.mark.nightly
def test_a_walker_without_a_gait_is_told_where_its_branch_folds():
    """The fold is that of `continue_gait` from straight legs."""
    none = jb.find_gait(light_legs(0.012), **PLAIN)
    assert none.outcome is not jb.gait.Search.FOUND
    said = jb.gait.explain_search(light_legs(0.012), none)
    told = float(said.partition("turns back at a fold at leg.centre_ahead = ")[2].split(",")[0])
    straight = light_legs(0.0)
    gait = jb.find_gait(straight, **PLAIN)
    bounds = (0.0, 0.002)
    branch = jb.continue_gait(straight, "leg.centre_ahead", bounds=bounds, guess=gait)
    folds = [each.value for each in branch.bifurcations if str(each.kind) == "fold"]
    assert told == pytest.approx(folds[0], rel=1e-3)


@pytest.mark.nightly
def test_a_kneed_walker_far_from_the_seed_is_found():
    """Heavy thighs and shanks: no walk about the seed's start goes on; the gait is unstable."""
    stop = jb.laws.RistowSchafer(K=300.0, c=3000.0, n=1.0)
    walker = jb.Kneed(
        m_thigh=0.4, J_thigh=5.8e-4, l_thigh=0.184, d_thigh=0.080, m_shank=0.2, J_shank=6.9e-4,
        l_shank=0.216, d_shank=0.096, w_shank=-0.004, r=0.08, hip_mass=1.0, epsilon=0.2, stop=stop,
    )  # fmt: skip
    seed = jb.seed_scene(slope=0.05)
    scene = jb.Scene(walker, seed.ground, seed.normal, seed.friction)
    gait = jb.find_gait(scene, **PLAIN)
    assert gait.outcome is jb.gait.Search.FOUND
    assert gait.found_by is jb.gait.FoundBy.CONTINUATION
    start, walk = gait.measures.state, jb.simulate(scene, gait.measures.state, footsteps=4)
    assert float(walk.t[-1]) > 3.0 * float(gait.measures.period)
    after = jax.tree.map(float, jb.return_map(scene, start).state)
    for name in recurring_names(start):
        assert getattr(after, name) == pytest.approx(float(getattr(start, name)), abs=1e-4)
