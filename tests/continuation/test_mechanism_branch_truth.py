"""A bifurcation of a mechanism's branch, against collocation in maximal coordinates."""

import numpy as np
import pytest
from _mechanisms import cases
from reference.mechanism_gait import checked_cycle

import jaxbiped as jb
from jaxbiped.continuation import BranchEvent
from tests.mechanism_numbers import tree_of


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
