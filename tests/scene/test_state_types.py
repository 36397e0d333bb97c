"""Types of states against what they must keep: one type for its names, in every process."""

import pickle
import subprocess
import sys

import jaxbiped as jb
from tests.mechanisms import scene_of


def test_names_that_agree_give_the_type_that_is_known():
    assert type(jb.seed_scene().state()) is jb.State
    assert type(jb.ladder()["rigid"].state()) is jb.dynamics.RigidState


def test_a_type_is_the_same_each_time():
    kind = type(scene_of("kneed").state())
    assert type(scene_of("kneed").state()) is kind
    assert type(scene_of("torso").state()) is not kind
    said = repr(scene_of("kneed").state(hip_x=1.0, hip_z=2.0, theta_thigh_1=0.5))
    assert said.startswith("State(hip_x=")
    assert "theta_thigh_1=" in said


def test_states_go_to_other_processes_and_come_back():
    state = type(scene_of("kneed").state())(*map(float, range(12)))
    again = pickle.loads(pickle.dumps(state))
    assert (again, type(again)) == (state, type(state))
    read = "import pickle, sys; print(pickle.loads(sys.stdin.buffer.read()).theta_thigh_1)"
    told = subprocess.run(
        [sys.executable, "-c", read], input=pickle.dumps(state), capture_output=True, check=True
    )
    assert told.stdout.strip() == b"2.0"
