"""Trades of a walk and of a gait, against equations written a second time and finer tolerances."""

import dataclasses

import numpy as np
import pytest
from reference.compliant import START
from reference.walks import reference_states, walk

import jaxbiped as jb
from jaxbiped.trade import GaitTrade, WalkTrade, Way
from tests.mechanisms import SEED_WITH_TORSO

DURATION = 2.0
LEGS = 0.40
TIME = np.sqrt(LEGS / 9.8)
UNITS = np.array([LEGS, LEGS, 1.0, 1.0, LEGS / TIME, LEGS / TIME, 1.0 / TIME, 1.0 / TIME])


@pytest.fixture(scope="module")
def trade():
    return WalkTrade(jb.seed_scene(), jb.seed_state(), DURATION, repeats=1)


@pytest.fixture(scope="module")
def truth(trade):
    return trade.truth()


@pytest.mark.slow
def test_the_truth_is_that_of_equations_written_a_second_time(trade, truth):
    times, states = reference_states()
    assert times[-1] == DURATION
    np.testing.assert_allclose(trade.units(), UNITS)
    np.testing.assert_allclose(truth.values["state"], states[-1] / UNITS, atol=1e-9)
    works = walk(2.0, 1e-11).ledger
    names = ("gravity_work", "damper_loss", "friction_loss", "stored_change")
    np.testing.assert_allclose(truth.values["energy"], [works[n] for n in names], atol=1e-7)


def test_references_disagree_by_less_than_any_row_has_to_be_told(truth):
    assert set(truth.floor) == {"state", "step_time", "energy"}
    assert max(truth.floor.values()) < 1e-10


def test_tighter_costs_more_steps_and_has_smaller_errors(trade, truth):
    loose, tight = (
        trade.row(Way("rodas4", "lanes", f"rtol={r:g}", r), truth) for r in (1e-5, 1e-8)
    )
    assert loose.outcome == tight.outcome == "ok"
    assert loose.attempted < tight.attempted
    for axis in ("state", "step_time", "energy"):
        assert 1e-12 < tight.errors[axis] < 0.1 * loose.errors[axis]


def test_a_walk_that_does_not_reach_its_end_is_a_row(trade, truth):
    upright = dataclasses.replace(trade.scene, ground=jb.Ground(slope=-0.3, g=9.8))
    row = trade._replace(scene=upright).row(Way("rodas4", "lanes", "rtol=1e-5", 1e-5), truth)
    assert row.outcome not in ("ok", "wrong")
    assert row.errors["state"] > 0.05


def test_a_way_that_is_not_allowed_is_a_row(trade, truth):
    row = trade.row(Way("rodas4", "lanes", "rtol=0", 0.0), truth)
    assert row.outcome.startswith("refused: ")
    assert row.cpu_s is None


def test_the_start_is_the_seeds():
    np.testing.assert_array_equal(np.array(jb.seed_state()), START)


pytestmark = pytest.mark.slow


def test_errors_of_a_rigid_gait_shrink_with_the_tolerance():
    seed = jb.seed_scene()
    trade = GaitTrade(jb.RigidScene(walker=seed.walker, ground=seed.ground), repeats=1)
    assert trade.parameters == ("slope",)
    truth = trade.truth()
    assert max(truth.floor.values()) < 1e-9
    loose, tight = (
        trade.row(Way("rodas5p", "lanes", f"rtol={r:g}", r), truth) for r in (1e-4, 1e-8)
    )
    assert loose.outcome == tight.outcome == "ok"
    assert loose.attempted < tight.attempted
    assert set(tight.errors) == {"period", "multiplier", "gradient"}
    for axis in ("multiplier", "gradient"):
        assert tight.errors[axis] < 1e-2 * loose.errors[axis]


def test_no_gait_no_truth():
    """Uphill nothing walks; on rigid feet the search is over soonest."""
    assert GaitTrade(jb.seed_scene(slope=-0.2)).parameters == ("K", "c", "xi")
    uphill = jb.with_parameters(jb.ladder()["rigid"], {"slope": -0.2})
    assert GaitTrade(uphill).truth() is None


@pytest.mark.nightly
def test_a_mechanisms_gait_is_traded_from_a_guess():
    start = jb.find_gait(SEED_WITH_TORSO, parameters=(), radius_sensitivities=False).measures.state
    trade = GaitTrade(SEED_WITH_TORSO, 1, start)
    truth = trade.truth()
    assert truth.floor["period"] < 1e-10
    row = trade.row(Way("rodas4", "lanes", "balanced", 2e-8), truth)
    assert row.outcome == "ok"
    assert row.errors["period"] < 1e-8
    assert row.errors["multiplier"] < 1e-6
