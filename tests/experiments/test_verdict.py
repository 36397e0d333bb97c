"""Verdicts on extreme cases, against cases where each kind is due."""

import dataclasses

import jax.tree_util as jtu
import numpy as np
import pytest
from extreme_cases.case import Case
from extreme_cases.verdict import judge

import jaxbiped as jb

pytestmark = pytest.mark.slow
SHORT = Case("K", {"K": 1e9}, {"K": 1e9}, duration=0.02)


def test_a_stiff_walk_is_accurate():
    found = judge(SHORT)
    assert (found.verdict, found.reason, found.outcome) == ("accurate", "", "walking")
    assert found.error <= found.told <= found.wanted == 1e-4
    assert found.doubt < 1e-7


def test_a_wrong_state_is_seen(monkeypatch):
    def simulate(*args, **kwargs):
        walk = simulate_truly(*args, **kwargs)
        moved = walk.state._replace(theta_1=walk.state.theta_1 + 1e-3)
        return dataclasses.replace(walk, state=moved)

    simulate_truly = jb.simulate
    monkeypatch.setattr(jb, "simulate", simulate)
    found = judge(SHORT)
    assert (found.verdict, found.reason) == ("silently_wrong", "the state is off")
    assert found.error == pytest.approx(1e-3, rel=1e-3)


def test_a_state_that_is_no_number_and_does_not_say_so_is_seen(monkeypatch):
    def simulate(*args, **kwargs):
        walk = simulate_truly(*args, **kwargs)
        return dataclasses.replace(walk, state=jtu.tree_map(lambda x: x * np.nan, walk.state))

    simulate_truly = jb.simulate
    monkeypatch.setattr(jb, "simulate", simulate)
    assert judge(SHORT).verdict == "silently_wrong"


def test_a_traceback_is_silently_wrong(monkeypatch):
    def simulate(*args, **kwargs):
        raise FloatingPointError("of no use")

    monkeypatch.setattr(jb, "simulate", simulate)
    found = judge(SHORT)
    assert found.verdict == "silently_wrong"
    assert "FloatingPointError" in found.reason


def test_a_start_underground_is_refused_in_a_sentence():
    found = judge(Case("depth [m]", {"depth [m]": 0.3}, changed={"height": -0.3}))
    assert found.verdict == "refused"
    assert "below the ground" in found.reason


def test_a_fallen_start_is_flagged():
    changed = {"theta_1": 1.5, "theta_2": -1.5, "height": 1e-3}
    found = judge(Case("angles [rad]", {"angles [rad]": 1.5}, changed=changed, duration=0.02))
    assert found.verdict == "flagged"
    assert "ended at its start" in found.reason


def test_what_a_number_cannot_keep_is_flagged():
    found = judge(dataclasses.replace(SHORT, asked={"accuracy": 1e-15}))
    assert found.verdict == "flagged"
    assert "accuracy not met" in found.reason
