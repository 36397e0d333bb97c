"""Rigid gaits of mechanisms, against central differences of their walks and the seed's own gait."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.scene._bodies import Body, Foot
from jaxbiped.scene._joint_parts import Coupling, Spring
from jaxbiped.scene._mechanism import Mechanism
from tests.mechanisms import BISECTING, FEET, LEGS, PAIR, TORSO, seed_walker
from tests.rigid_walkers import rigid_seed

GROUND = jb.Ground(slope=0.03)
START = dict(theta_leg_1=-0.28, theta_leg_2=0.28, omega_leg_1=-1.1, omega_leg_2=-1.7)


def with_torso(joint):
    walker = Mechanism(bodies=(*LEGS, TORSO), feet=FEET, joints=(joint,), mirror=PAIR)
    return jb.RigidScene(walker, GROUND)


def after_a_footstep(scene, rows):
    """Recurring coordinates after a footstep, from rows of them."""
    kind = type(scene.state())
    ends = []
    for row in rows:
        start = kind(jnp.zeros(()), *map(jnp.asarray, row))
        ends.append(jb.rigid_walk(scene, start, footsteps=1, rtol=1e-12, engine="lanes").final[1:])
    return np.array(ends)


@pytest.mark.slow
@pytest.mark.parametrize(
    "joint", [Coupling(BISECTING), Spring(BISECTING, stiffness=16.0, damping=0.6)]
)
def test_multipliers_are_those_of_the_walk(joint):
    scene = with_torso(joint)
    plain = dict(parameters=(), radius_sensitivities=False)
    gait = jb.find_gait(scene, scene.state(**START), accuracy="tight", **plain)
    assert gait.outcome is jb.gait.Search.FOUND
    at = np.array(gait.measures.state[1:])
    steps = 1e-5 * np.eye(at.size)
    found = after_a_footstep(scene, [at, *(at + steps), *(at - steps)])
    np.testing.assert_allclose(found[0], at, atol=1e-9)
    columns = (found[1 : 1 + at.size] - found[1 + at.size :]) / 2e-5
    numbers = np.linalg.eigvals(columns.T)
    told = np.sort(np.abs(np.array(gait.multipliers)))[::-1]
    np.testing.assert_allclose(np.sort(np.abs(numbers))[::-1][: told.size], told, atol=2e-6)


def test_the_seed_written_as_data_walks_as_the_seed():
    scenes = [jb.RigidScene(seed_walker(), jb.Ground(slope=0.02)), rigid_seed(0.02)]
    state = scenes[0].state(theta_1=-0.24, theta_2=0.24, omega_1=-1.09, omega_2=-1.64)
    assert type(state) is jb.dynamics.RigidState
    ends = [
        jb.rigid_walk(scene, state, footsteps=3, accuracy="tight", engine="lanes").final
        for scene in scenes
    ]
    np.testing.assert_allclose(np.array(ends[0]), np.array(ends[1]), rtol=0.0, atol=1e-11)


@pytest.mark.slow
def test_bars_at_draft_hold_the_error_of_the_gait_s_place():
    """A search ends at a looser map's fixed point, from where a looser solve changes little.

    Without that error, derivatives of these gaits are up to 6.2, 2.9 and 2.3 bars off.
    """
    for stiffness, slope, m in ((0.25, 0.0111, 1.2), (0.3, 0.0167, 0.8), (0.5, 0.0233, 1.0)):
        seed = jb.with_parameters(rigid_seed(slope), {"m": m})
        scene = dataclasses.replace(seed, actuation=(jb.actuation.HipSpring(k=stiffness),))
        gait = jb.find_gait(scene, accuracy="draft")
        exact = jb.find_gait(scene, gait.measures.state, accuracy="tight")
        for name in ("period", "step_length", "spectral_radius"):
            told, true, bars = (
                np.asarray(getattr(slopes, name))
                for slopes in (gait.sensitivities, exact.sensitivities, gait.sensitivity_errors)
            )
            assert np.all(np.abs(told - true) <= bars), name


@pytest.mark.slow
def test_a_walker_with_shanks_strikes_where_its_foot_comes_down():
    """Shanks that springs hold straight, stiffer and stiffer: the compass walker."""
    times = []
    for stiffness in (200.0, 800.0, 3200.0):
        scene = jb.RigidScene(shanks(stiffness), GROUND)
        start = scene.state(
            theta_thigh_1=-0.28, theta_shank_1=-0.28, theta_thigh_2=0.28, theta_shank_2=0.28,
            omega_thigh_1=-1.1, omega_shank_1=-1.1, omega_thigh_2=-1.7, omega_shank_2=-1.7,
        )  # fmt: skip
        walk = jb.rigid_walk(scene, start, footsteps=1, accuracy="tight", engine="lanes")
        assert walk.outcome is jb.Ending.WALKING
        times.append(float(walk.t[-1]))
        before = walk.final
        foot = jb.dynamics.rigid_checks(scene, jb.dynamics.exchange_legs(scene, before)).clearance
        np.testing.assert_allclose(np.array(foot), 0.0, atol=1e-9)
    scene = jb.RigidScene(Mechanism(bodies=LEGS, feet=FEET, mirror=PAIR), GROUND)
    start = scene.state(**START)
    straight = jb.rigid_walk(scene, start, footsteps=1, accuracy="tight", engine="lanes")
    off = np.abs(np.array(times) - float(straight.t[-1]))
    assert off[2] < 0.5 * off[1] < 0.25 * off[0]
    assert off[2] < 1e-2


def shanks(stiffness):
    """The legs of `LEGS` cut at a knee; both parts together are one of these."""
    parts = [
        (
            Body(f"thigh_{i}", mass=0.5, inertia=0.00355, centre=0.05),
            Body(f"shank_{i}", mass=0.5, inertia=0.00355, centre=0.0, parent=f"thigh_{i}", at=0.15),
        )
        for i in (1, 2)
    ]
    damping = 0.2 * stiffness**0.5
    return Mechanism(
        bodies=(*parts[0], *parts[1]),
        feet=tuple(Foot(f"shank_{i}", centre=0.17, radius=0.08) for i in (1, 2)),
        joints=tuple(Spring(f"shank_{i}", stiffness=stiffness, damping=damping) for i in (1, 2)),
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
    )
