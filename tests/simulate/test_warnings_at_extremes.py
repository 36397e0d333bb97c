"""What the extremes broke, against what was expected: errors with a sign, no traceback."""

import numpy as np
import pytest
from extreme_cases.case import Case
from extreme_cases.verdict import judge

import jaxbiped as jb

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("dt", [1e-1, 1e-2, 1e-3])
def test_steps_of_one_size_that_are_too_long_are_told(dt):
    with pytest.warns(RuntimeWarning, match=f"dt = {dt:g} is too long"):
        jb.simulate(jb.seed_scene(), jb.seed_state(), duration=0.03, dt=dt, save="end")


def test_steps_whose_other_solve_is_as_wrong_by_chance_are_told():
    case = Case(
        "dt [s], rodas5p", {"dt [s], rodas5p": 3e-4}, {"xi": 1e6}, duration=0.03,
        asked={"dt": 3e-4, "solver": "rodas5p"},
    )  # fmt: skip
    found = judge(case)
    assert found.error > 1e-2
    assert found.verdict == "flagged"


def test_short_steps_of_one_size_are_not(recwarn):
    walk = jb.simulate(jb.seed_scene(), jb.seed_state(), duration=3e-3, dt=1e-6, save="end")
    assert walk.outcome is jb.Ending.WALKING
    assert not [each for each in recwarn if each.category is RuntimeWarning]


def test_an_implicit_solver_takes_steps_of_one_size():
    walk = jb.simulate(
        jb.seed_scene(), jb.seed_state(), duration=1e-5, dt=1e-6, solver="kvaerno3", save="end"
    )
    assert np.isfinite(float(walk.final.hip_z))


def test_a_tolerance_far_too_coarse_for_the_slip_is_told(recwarn):
    how = dict(duration=1e-3, rtol=1e-3, save="end")
    jb.simulate(jb.seed_scene(), jb.seed_state(), **how)
    assert not [each for each in recwarn if each.category is RuntimeWarning]
    with pytest.warns(RuntimeWarning, match=r"rtol = 0\.001 is too coarse for v0 = 1e-07"):
        jb.simulate(jb.seed_scene(v0=1e-7), jb.seed_state(), **how)


def test_an_accuracy_by_a_number_holds_where_slip_is_slow():
    case = Case(
        "accuracy", {"accuracy": 1e-5}, {"v0": 1e-7}, start="striking", duration=0.03,
        asked={"accuracy": 1e-5},
    )  # fmt: skip
    found = judge(case)
    assert found.verdict == "accurate"
    assert found.error <= found.told
