"""Verdicts, against results and checks that are written down: by how much they are off."""

import numpy as np
import pytest
from extreme_cases import verdict as verdicts
from extreme_cases.case import Case, check_numbers
from extreme_cases.verdict import judge
from reference.scipy_solves import Checked

import jaxbiped as jb
from jaxbiped.solve._error_estimate import ErrorEstimate
from jaxbiped.solve._trajectory import Trajectory

CASE = Case("K", {"K": 1e6}, {"K": 1e6}, duration=0.02)
STATE = np.array([float(leaf) for leaf in jb.seed_state()])


@pytest.mark.parametrize(
    ("off", "doubt", "met", "lowest", "verdict"),
    [
        (0.9e-4, 1e-7, True, 0.1, "accurate"),
        (1.1e-4, 1e-7, True, 0.1, "silently_wrong"),
        (0.0, 0.31e-4, True, 0.1, "unresolved"),
        (0.0, 0.29e-4, True, 0.1, "accurate"),
        (1.1e-4, 1e-7, False, 0.1, "flagged"),
        (0.0, 1e-7, True, -0.01, "silently_wrong"),
        (np.nan, 1e-7, True, 0.1, "silently_wrong"),
    ],
)
def test_a_verdict_is_by_the_error_that_was_asked_for(
    off, doubt, met, lowest, verdict, monkeypatch
):
    """The rate of leg 1 is off by so much, in units of √(g/l), where 1e-4 was wanted."""
    moved = STATE + off * np.sqrt(9.8 / 0.4) * np.eye(8)[6]
    error = ErrorEstimate(None, 1e-5, 1e-4, 1e-7, 2, met, "" if met else "it is too stiff")
    whole = np.asarray(0)
    walk = Trajectory(np.array([0.02]), jb.State(*moved[:, None]), whole, whole, whole, error=error)
    monkeypatch.setattr(jb, "simulate", lambda *_, **__: walk)
    monkeypatch.setattr(verdicts, "checked", lambda *_, **__: Checked(STATE, doubt, lowest))
    found = judge(CASE)
    assert found.verdict == verdict
    assert found.wanted == 1e-4
    if verdict == "accurate":
        assert found.error == pytest.approx(off, abs=1e-15)
        assert (found.told, found.outcome) == (1e-5, "walking")
    if not met:
        assert found.reason == "accuracy not met: it is too stiff"


@pytest.mark.parametrize(
    ("rate", "said"), [(0.1, ""), (-1.0, "no leg rests where it ended as stopped")]
)
def test_a_walker_that_stopped_has_a_leg_that_rests(rate, said):
    """Slower than 0.11 √(g/l), which is 0.54 rad/s on any slope."""
    still = np.array([*STATE[:6], rate, rate])
    numbers = check_numbers(jb.seed_scene(slope=-0.1))
    assert verdicts._wrong_ending(jb.Ending.STOPPED, Checked(still, 0.0, 0.1), numbers) == said
