"""Branches of mechanisms, against gaits' own sensitivities, collocation, and their datasets."""

import numpy as np
import pytest
from _mechanisms import cases
from reference.mechanism_flow import checked_cycle

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent
from tests.mechanism_numbers import tree_of
from tests.mechanisms import SEED_WITH_TORSO

STIFFNESS = "torso.spring.stiffness"


@pytest.mark.slow
def test_a_branch_along_a_spring_has_the_gaits_own_slope():
    gait = jb.find_gait(SEED_WITH_TORSO, parameters=(STIFFNESS,), radius_sensitivities=False)
    branch = jb.continue_gait(
        SEED_WITH_TORSO, STIFFNESS, bounds=(7.0, 9.0), guess=gait, max_points=3, largest_step=0.2
    )
    values = np.array([point.value for point in branch.points])
    periods = np.array([point.period for point in branch.points])
    slope = np.polynomial.Polynomial.fit(values - 8.0, periods, 4).deriv()(0.0)
    assert slope == pytest.approx(float(gait.sensitivities.period[0]), rel=1e-5)
    again = jb.continuation.open_branch(branch.to_dataset(), SEED_WITH_TORSO)
    assert again.state_type is type(gait.measures.state)
    for name in again.state_type._fields:
        assert float(getattr(again.state(0), name)) == float(getattr(branch.state(0), name))


@pytest.mark.nightly
def test_a_walker_with_a_torso_doubles_its_period_where_its_multiplier_is_minus_one():
    scene = jb.with_parameters(cases()["torso coupled"].scene, {"slope": 0.0715})
    how = dict(bounds=(0.0715, 0.0735), accuracy="tight", max_points=40)
    branch = jb.continue_gait(scene, "slope", **how)
    (found,) = branch.bifurcations
    assert found.kind is BranchEvent.PERIOD_DOUBLING
    tree = tree_of(branch.scene_at(found))
    none = np.zeros((0, len(tree.p)))
    checked = checked_cycle(tree, branch.state(found), found.point.period, none, exchanges=True)
    assert checked.residual < 5e-9
    assert checked.period == pytest.approx(found.point.period, abs=1e-9)
    assert np.min(np.abs(checked.multipliers + 1.0)) < 1e-6
