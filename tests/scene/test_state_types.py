"""Types of states against what they must keep: one type for its names, in every process."""

import pickle
import subprocess
import sys

import jaxbiped as jb
from jaxbiped.caching._fingerprint import fingerprint
from jaxbiped.scene._state_types import state_type_of

NAMES = ("hip_x", "theta_thigh_1")


def test_names_that_agree_give_the_type_that_is_known():
    assert state_type_of(jb.State._fields) is jb.State
    assert state_type_of(jb.dynamics.RigidState._fields) is jb.dynamics.RigidState


def test_a_type_is_the_same_each_time_and_has_an_identity():
    kind = state_type_of(NAMES)
    assert state_type_of(list(NAMES)) is kind
    other = state_type_of(("hip_x", "theta_thigh_2"))
    assert len({fingerprint(kind), fingerprint(other), None}) == 3
    assert repr(kind(1.0, 2.0)) == "State(hip_x=1.0, theta_thigh_1=2.0)"


def test_states_go_to_other_processes_and_come_back():
    state = state_type_of(NAMES)(1.0, 2.0)
    again = pickle.loads(pickle.dumps(state))
    assert (again, type(again)) == (state, type(state))
    read = "import pickle, sys; print(pickle.loads(sys.stdin.buffer.read()).theta_thigh_1)"
    told = subprocess.run(
        [sys.executable, "-c", read], input=pickle.dumps(state), capture_output=True, check=True
    )
    assert told.stdout.strip() == b"2.0"
