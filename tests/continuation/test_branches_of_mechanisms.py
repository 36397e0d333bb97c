"""Branches of mechanisms: against the gaits' own sensitivities, and kept in datasets."""

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.continuation._branch_point import axis_of
from jaxbiped.continuation._continuation_setup import continuation_setup
from tests.mechanisms import scene_of
from tests.optimise.test_optima_of_mechanisms import TORSO

STIFFNESS = "torso.spring.stiffness"


@pytest.mark.parametrize(("name", "footsteps"), [("torso", 3), ("unequal", 6)])
def test_a_cycle_is_as_many_arrivals(name, footsteps):
    scene = scene_of(name)
    axis = axis_of(scene, "slope", (0.02, 0.04), None)
    how = dict(accuracy="balanced", engine="auto")
    setup = continuation_setup(scene, axis, footsteps=footsteps, **how)
    assert (setup.arrivals, setup.footsteps) == (3, footsteps)
    setup = continuation_setup(scene, axis, footsteps=None, **how)
    assert (setup.arrivals, setup.footsteps) == (1, footsteps // 3)


@pytest.mark.nightly
def test_a_branch_along_a_spring_has_the_gaits_own_slope():
    gait = jb.find_gait(TORSO, parameters=(STIFFNESS,), radius_sensitivities=False)
    branch = jb.continue_gait(
        TORSO, STIFFNESS, bounds=(7.0, 9.0), guess=gait, max_points=3, largest_step=0.2
    )
    values = np.array([point.value for point in branch.points])
    periods = np.array([point.period for point in branch.points])
    slope = np.polynomial.Polynomial.fit(values - 8.0, periods, 4).deriv()(0.0)
    assert slope == pytest.approx(float(gait.sensitivities.period[0]), rel=1e-5)
    again = jb.continuation.open_branch(branch.to_dataset(), TORSO)
    assert again.state_type is type(gait.measures.state)
    for name in again.state_type._fields:
        assert float(getattr(again.state(0), name)) == float(getattr(branch.state(0), name))
