"""Switches and what jumps there, and sections, against each written out a second time."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.hybrid import Rolling, switches
from jaxbiped.scene.laws import normal_law_like
from tests.mechanisms import FEET, LEGS, PAIR, scene_of, start_of

SEED = jb.seed_scene()
LOW = jb.seed_state()._replace(
    hip_z=jnp.asarray(0.3945), theta_1=jnp.asarray(-0.1), omega_1=jnp.asarray(0.5)
)
"""Leg 2 stands 0.9 mm deep; leg 1 swings underground, where the clearance rule lets it pass."""


def told(scene, state):
    """Of each switch its value, whether it is live, and its two flags."""
    flags = [(each.force_jumps, each.corner) for each in switches(scene, state)]
    found = jax.jit(lambda y: [(s.value, jnp.asarray(s.live)) for s in switches(scene, y)])(state)
    return [(float(v), bool(live), *flag) for (v, live), flag in zip(found, flags, strict=True)]


@pytest.mark.parametrize("leg", [1, 2])
def test_switches_of_the_seeds_feet(leg):
    foot = jb.dynamics.feet(SEED, LOW)[leg - 1]
    depth, rate, slip = map(float, (foot.penetration, foot.penetration_rate, foot.slip_speed))
    stands = leg == 2
    assert depth > 0.0
    turning = float((LOW.omega_1, LOW.omega_2)[leg - 1])
    carries = stands and 1e6 * depth**1.5 + 1e7 * depth * rate > 0.0
    own = told(SEED, LOW)[6 * (leg - 1) : 6 * leg]
    expected = [
        (depth, turning < 0.0, False, False),
        (1e6 * depth**0.5 + 1e7 * rate, stands, False, True),
        (slip - 1e-4, carries, False, True),
        (slip + 1e-4, carries, False, True),
        (slip, carries, False, True),
        (turning, 1e6 * depth**1.5 + 1e7 * depth * rate > 0.0, True, False),
    ]
    for ours, (value, live, *flags) in zip(own, expected, strict=True):
        assert ours[0] == pytest.approx(value, rel=1e-9)
        assert ours[1] is live
        assert list(ours[2:]) == flags


def test_a_force_that_jumps_at_touchdown_is_told_and_a_rule_that_is_none_is_not():
    law = normal_law_like("kelvin-voigt", K=1e6, c=1e7, n=1.5, mass=2.0)
    scene = dataclasses.replace(SEED, normal=law, clearance=jb.laws.AlwaysTouching())
    found = told(scene, LOW)
    assert len(found) == 10
    jumps = [each[2] for each in found]
    assert jumps == [True, False, False, False, False] * 2
    both = jb.dynamics.feet(scene, LOW)
    assert [found[0][0], found[5][0]] == pytest.approx([float(f.penetration) for f in both])
    assert found[0][1]
    assert found[5][1]


SCENE = jb.seed_scene()


@pytest.mark.parametrize("angle", [-0.2, 0.15])
def test_mid_stance_is_where_the_stance_leg_passes_the_slopes_normal(angle):
    """Its value rises as the leg turns back, whatever the other one does."""
    state = jb.seed_state()._replace(theta_1=np.float64(0.3), theta_2=np.float64(angle))
    behind = -(SCENE.walker.l - SCENE.walker.r) * np.sin(angle)
    assert float(jb.MidStance().value(SCENE, state)) == pytest.approx(float(behind), rel=1e-13)


def test_mid_stance_of_a_chain_is_where_its_foot_is_below_the_hip():
    """Of two legs with knees and of two that are unlike, the last one stands."""
    kneed = scene_of("kneed")
    state = start_of("kneed", kneed)._replace(theta_thigh_2=0.2, theta_shank_2=-0.1)
    ahead = 0.184 * np.sin(0.2) + 0.136 * np.sin(-0.1)
    assert float(jb.MidStance().value(kneed, state)) == pytest.approx(-ahead, rel=1e-13)
    unlike = scene_of("unequal")
    state = start_of("unequal", unlike)
    ahead = 0.32 * np.sin(float(state.theta_leg_2))
    assert float(jb.MidStance().value(unlike, state)) == pytest.approx(-ahead, rel=1e-13)


def test_mid_stance_counts_where_the_stance_leg_touches():
    low = jb.seed_state()._replace(theta_1=np.float64(0.4), theta_2=np.float64(0.0))
    for height, counts in ((0.399, True), (0.401, False)):
        state = low._replace(hip_z=np.float64(height))
        assert bool(jb.MidStance().counts(SCENE, state)) is counts


@pytest.mark.parametrize("stands", [-0.19, -0.21])
def test_a_rigid_walker_arrives_where_the_foot_ahead_comes_down(stands):
    """A swing foot of an equal leg is on the ground where both angles are as large."""
    rigid, swings = jb.ladder()["rigid"], 0.2
    state = jb.dynamics.RigidState(*map(np.float64, (0.0, swings, stands, -0.3, -1.0)))
    value, counts = Rolling().arrival(jb.HeelStrike(), rigid, state)
    assert bool(value > 0.0) == (np.cos(stands) < np.cos(swings))
    assert bool(counts)
    behind = state._replace(theta_1=-state.theta_1, theta_2=-state.theta_2)
    assert not bool(Rolling().arrival(jb.HeelStrike(), rigid, behind)[1])


def test_legs_are_straight_where_each_is_one_body_on_the_hip_with_its_foot_along_it():
    """The opening at a heel strike is then both angles; else how low the foot is, by the height."""
    swings, stands = -0.1, 0.3

    def strikes_at(mechanism):
        scene = jb.RigidScene(mechanism, SEED.ground)
        names = [name for name in scene.state_type._fields if name.startswith("theta")]
        angles = {name: swings if name.endswith("1") else stands for name in names}
        value, _ = Rolling().arrival(jb.HeelStrike(), scene, scene.state(**angles))
        return float(value)

    def lower(length, *sides):
        """How much lower the swing foot is, by points at this distance, so far ahead."""
        depths = [
            max(length * np.cos(angle) - side * np.sin(angle) for side in sides)
            for angle in (swings, stands)
        ]
        return (depths[0] - depths[1]) / 0.4

    ahead = tuple(jb.Foot(f"leg_{i}", centre=(0.32, 0.01), radius=0.08) for i in (1, 2))
    flat = tuple(
        jb.Foot(f"leg_{i}", name=name, centre=(0.4, side), radius=0.0)
        for i in (1, 2)
        for name, side in (("heel", -0.02), ("toe", 0.05))
    )
    for feet, value in (
        (FEET, -(swings + stands)),
        (ahead, lower(0.32, 0.01)),
        (flat, lower(0.4, -0.02, 0.05)),
    ):
        mechanism = jb.Mechanism(bodies=LEGS, feet=feet, mirror=PAIR)
        assert strikes_at(mechanism) == pytest.approx(value, rel=1e-12)
    assert strikes_at(SEED.mechanism) == pytest.approx(-(swings + stands), rel=1e-12)
    assert strikes_at(scene_of("kneed").mechanism) == pytest.approx(lower(0.32, 0.0), rel=1e-12)


@pytest.mark.parametrize(("other", "own"), [(-0.2, 0.15), (0.15, -0.2)])
def test_a_heel_strike_counts_where_the_foot_comes_down_ahead_of_the_other(other, own):
    """The leg that lands is then called the second; a leg off the ground lands nowhere."""
    for height in (0.38, 0.6):
        state = LOW._replace(
            hip_z=jnp.asarray(height), theta_1=jnp.asarray(other), theta_2=jnp.asarray(own)
        )
        lands = float(jb.dynamics.feet(SEED, state)[1].penetration) > 0.0
        assert lands == (height == 0.38)
        is_ahead = np.sin(own) > np.sin(other)
        assert bool(jb.HeelStrike().counts(SEED, state)) == (lands and is_ahead)
