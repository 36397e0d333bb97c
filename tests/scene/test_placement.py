"""Placement of mechanisms against trigonometry and the rigid walker's rolling."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import WALKERS
from tests.scene.test_mechanism import BISECTING, FEET, LEGS, TORSO, kneed, two_legs

SEED = jb.seed_scene().walker


def placed(walker, slope, standing=None, **values):
    """The state in which a walker stands on compliant ground."""
    seed = jb.seed_scene(slope=slope)
    scene = jb.Scene(walker, seed.ground, seed.normal, seed.friction)
    return scene.state(standing=standing, **values)


def test_a_walker_just_touches_with_its_lowest_foot():
    found = placed(SEED, 0.0, theta_1=0.3, theta_2=-0.1)
    assert type(found) is jb.State
    assert float(found.hip_z) == pytest.approx(0.08 + 0.32 * math.cos(0.1), rel=1e-15)
    assert float(found.theta_1) == 0.3
    assert {float(x) for x in (found.hip_x, found.hip_vx, found.hip_vz, found.omega_2)} == {0.0}


def test_a_standing_foot_rolls_as_the_rigid_walkers_does():
    values = {"hip_x": 0.1, "theta_1": -0.25, "theta_2": 0.17, "omega_1": 0.3, "omega_2": -1.2}
    scene = jb.RigidScene(SEED, jb.Ground(slope=0.02))
    rigid = jb.dynamics.RigidState(**{k: jnp.asarray(v) for k, v in values.items()})
    expected = jb.dynamics.whole_state(scene, rigid)
    found = placed(SEED, 0.02, "2", **values)
    np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_a_knee_and_a_point_ahead_by_hand():
    thigh, shank, omega_thigh, omega_shank = 0.3, -0.2, 1.0, -2.0
    values = dict(
        theta_thigh_2=thigh, theta_shank_2=shank,
        omega_thigh_2=omega_thigh, omega_shank_2=omega_shank,
    )  # fmt: skip
    found = placed(kneed(), 0.0, "shank_2", **values)
    height = 0.184 * math.cos(thigh) + 0.136 * math.cos(shank) + 0.08
    assert float(found.hip_z) == pytest.approx(height, rel=1e-15)
    along = 0.184 * math.cos(thigh) * omega_thigh + (0.136 * math.cos(shank) + 0.08) * omega_shank
    up = 0.184 * math.sin(thigh) * omega_thigh + 0.136 * math.sin(shank) * omega_shank
    assert float(found.hip_vx) == pytest.approx(-along, rel=1e-14)
    assert float(found.hip_vz) == pytest.approx(-up, rel=1e-14)


@pytest.mark.parametrize("pitch", [-0.1, 0.1])
def test_of_a_flat_foot_the_lower_end_stands(pitch):
    end = {"foot_2.heel": -0.04, "foot_2.toe": 0.08}
    name = "foot_2.heel" if pitch > 0.0 else "foot_2.toe"
    values = {"theta_foot_2": pitch, "omega_foot_2": 2.0}
    found = placed(WALKERS["flat"], 0.0, "foot_2", **values)
    height = 0.36 + 0.03 * math.cos(pitch) - end[name] * math.sin(pitch) + 0.01
    assert float(found.hip_z) == pytest.approx(height, rel=1e-15)
    by_name = placed(WALKERS["flat"], 0.0, name, **values)
    assert found == by_name


def test_coupled_bodies_follow_the_legs_and_the_vertical():
    foot = (*FEET, jb.Foot("torso", centre=0.6))
    leaning = jb.Coupling({"torso": 1, "vertical": -1}, rest=0.2)
    walker = two_legs(leaning, bodies=(*LEGS, TORSO), feet=foot)
    found = placed(walker, 0.3, "torso", omega_leg_1=1.0)
    assert float(found.hip_z) == pytest.approx(0.6 * math.cos(0.5), rel=1e-15)
    assert float(found.hip_vx) == 0.0
    bisecting = two_legs(jb.Coupling(BISECTING), bodies=(*LEGS, TORSO), feet=foot)
    turning = placed(bisecting, 0.3, "torso", omega_leg_1=1.0)
    assert float(turning.hip_vx) == pytest.approx(-0.3, rel=1e-15)


def test_arrays_make_a_batch_and_derivatives_pass():
    angles = np.linspace(-0.3, 0.3, 5)
    many = placed(SEED, 0.0, "2", theta_2=angles, omega_2=-1.0)
    assert {leaf.shape for leaf in many} == {(5,)}
    np.testing.assert_allclose(many.hip_z, 0.08 + 0.32 * np.cos(angles), rtol=1e-15)

    def height(angle):
        return placed(SEED, 0.0, "2", theta_2=angle).hip_z

    assert float(jax.jit(jax.grad(height))(0.2)) == pytest.approx(-0.32 * math.sin(0.2), rel=1e-14)


def test_what_is_named_is_kept():
    values = {"hip_z": 1.0, "hip_vx": 0.2, "bristle_1": 0.5}
    found = jb.ladder()["bristles"].state(standing="2", **values)
    assert found._fields == (*jb.State._fields, "bristle_1", "bristle_2")
    assert [float(getattr(found, name)) for name in values] == [1.0, 0.2, 0.5]


@pytest.mark.parametrize(
    ("values", "standing", "words"),
    [
        ({"theta_3": 0.1}, None, "choose one of hip_x, hip_z, theta_leg_1"),
        ({"theta_leg_1": math.nan}, None, "theta_leg_1 = nan"),
        ({"theta_torso": 0.1}, None, "follow from the other angles"),
        ({}, "torso", "choose one of leg_1, leg_1.foot, leg_2, leg_2.foot"),
    ],
)
def test_unknown_names_are_refused(values, standing, words):
    walker = two_legs(jb.Coupling(BISECTING), bodies=(*LEGS, TORSO))
    with pytest.raises(jb.ArgumentError, match=words):
        placed(walker, 0.0, standing, **values)


@pytest.mark.parametrize("angle", np.linspace(-0.4, 0.4, 9))
def test_rounding_does_not_tell_whether_the_standing_foot_touches(angle):
    scene = jb.seed_scene()
    state = scene.state(theta_1=-angle, theta_2=angle, omega_2=-1.0, standing="2")
    assert 0.0 < float(jb.dynamics.feet(scene, state)[1].penetration) < 1e-15


@pytest.mark.parametrize("shape", [(), (2,)])
def test_a_body_that_turns_without_inertia_is_named_in_many_scenes_too(shape):
    """A thigh without mass on the hip of a torso, and a shank that is a mass point."""
    point = dict(mass=np.ones(shape), inertia=np.zeros(shape))
    for turning, bodies in (
        ("leg", (jb.Body("leg", centre=0.0, **point), TORSO)),
        ("thigh", (
            jb.Body("thigh", mass=0.0, inertia=0.0, centre=0.1),
            jb.Body("leg", parent="thigh", at=0.2, centre=0.1, **point), TORSO,
        )),
    ):  # fmt: skip
        with pytest.raises(jb.ArgumentError, match=rf"^Body\('{turning}'\) can turn without"):
            jb.Mechanism(bodies=bodies, feet=(jb.Foot("leg", centre=0.3),))
