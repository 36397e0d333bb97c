"""Error bars of walks, against witnesses made by hand; what lanes are asked; doors."""

import jax
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import Ending, Simulation, Trajectory
from jaxbiped.simulate._accurate_walk import Witness, judge_walk
from jaxbiped.simulate._backends import _saveat, lane_request
from jaxbiped.simulate._rigid_simulation import RigidSimulation
from jaxbiped.simulate._start import Options
from tests.rigid_walkers import STABLE, rigid_seed, simplest_state

SCENE, STATE = jb.seed_scene(), jb.seed_state()
TIME = np.sqrt(0.4 / 9.8)


def walk(ending=Ending.WALKING, end=1.0, **changes):
    leaves = {name: np.array([float(leaf)]) for name, leaf in STATE._asdict().items()}
    moved = {name: leaves[name] + change for name, change in changes.items()}
    whole = np.asarray(0)
    return Trajectory(np.array([end]), jb.State(**leaves | moved), np.asarray(int(ending)), whole,
                      whole)  # fmt: skip


def test_a_bar_is_the_larger_weighed_change_and_a_share_of_the_largest():
    witnesses = (Witness(walk(hip_x=4e-3), 1.0), Witness(walk(hip_x=-3e-3, theta_1=1e-4), 2.0))
    bars, relative, reason = judge_walk(SCENE, walk(), witnesses)
    assert reason == ""
    assert float(bars["state"].hip_x[0]) == pytest.approx(6e-3)
    # The others are a twentieth of the largest, 6e-3/0.4, in their own units.
    assert float(bars["state"].theta_1[0]) == pytest.approx(0.05 * 0.015)
    assert float(bars["state"].omega_2[0]) == pytest.approx(0.05 * 0.015 / TIME)
    assert float(bars["state"].hip_vz[0]) == pytest.approx(0.05 * 0.015 * 0.4 / TIME)
    assert relative == pytest.approx(0.015)
    _, relative, _ = judge_walk(SCENE, walk(), (Witness(walk(end=1.0 + 0.02 * TIME), 1.0),) * 2)
    assert relative == pytest.approx(0.02)


@pytest.mark.parametrize("place", [0, 1])
def test_a_witness_that_ends_otherwise_leaves_the_error_open(place):
    witnesses = [Witness(walk(), 1.0), Witness(walk(), 2.0)]
    witnesses[place] = Witness(walk(Ending.STUMBLED), 1.0)
    bars, relative, _ = judge_walk(SCENE, walk(), tuple(witnesses))
    assert relative == np.inf
    assert np.isinf(bars["state"].hip_x).all()
    lost = walk(Ending.OUT_OF_STEPS)
    assert (
        judge_walk(SCENE, lost, (Witness(lost, 1.0),) * 2)[2] == "the solve ended as out of steps"
    )


def test_lanes_are_asked_for_what_the_user_said():
    run = Simulation.prepare(SCENE, STATE, footsteps=3, rtol=1e-5, max_solver_steps=77, save="end")
    asked = lane_request(run).inputs
    told = jax.tree.map(float, (asked.footsteps, asked.rtol, asked.atol, asked.max_attempts))
    assert told == (3.0, pytest.approx(1e-5), pytest.approx(1e-7), 77.0)
    # A hundred seconds for each footstep.
    assert float(asked.patience) == float(asked.duration) == 300.0
    assert 300.0 * (1.0 - 1e-12) < float(asked.almost) < 300.0
    assert [float(leaf) for leaf in asked.state] == [float(leaf) for leaf in STATE]


def test_xla_saves_what_the_user_asked_for():
    times = np.array([0.1, 0.25])
    at_times, at_end, every_step = (
        _saveat(Simulation.prepare(SCENE, STATE, duration=0.3, **how))
        for how in ({"save": times}, {"save": "end"}, {"save": "steps"})
    )
    np.testing.assert_array_equal(at_times.subs.ts, times)
    assert not at_times.subs.t1
    assert (at_end.subs.t1, at_end.subs.ts, at_end.dense) == (True, None, False)
    assert (every_step.subs.t0, every_step.subs.steps, every_step.dense) == (True, 1, True)


def longest_of(**numbers):
    """How long a rigid walk of three footsteps may take, relative to the seed's walker."""
    plain = rigid_seed()
    scenes = plain, jb.with_parameters(plain, numbers)
    walks = [
        RigidSimulation.of(scene, simplest_state(*STABLE), Options(footsteps=3)) for scene in scenes
    ]
    return float(walks[1].duration / walks[0].duration)


def test_footsteps_of_rigid_feet_are_waited_for_in_units_of_the_pendulums_time():
    """Times go with √(l/g): four times the lengths double them, four times g halves them."""
    lengths = {name: 4.0 * value for name, value in dict(l=0.4, d=0.1, r=0.08).items()}
    assert longest_of(**lengths) == pytest.approx(2.0)
    assert longest_of(g=4.0 * 9.8) == pytest.approx(0.5)


@pytest.mark.parametrize("solver", ["dopri8", "tsit5", "dopri5", "bosh3"])
def test_the_witness_of_a_rigid_walk_is_another_method(solver):
    """Which estimates the error that the walk's own method makes."""
    how = {} if solver == "dopri8" else {"solver": solver}
    run = RigidSimulation.of(rigid_seed(), simplest_state(*STABLE), Options(footsteps=3, **how))
    other, share, weight = run.by_other_method()
    assert other.method != run.method
    assert min(share, weight) > 0.0
