"""Sections, against the angle of the stance leg and the places of feet."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.variational._hybrid_system import Rolling
from tests.mechanisms import scene_of, start_of

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
