"""What a torque that is free in time could still save, against optima that are known."""

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import jaxbiped as jb
from tests.optimise.evaluations import finer_spline, with_other_goal
from tests.optimise.test_unknowns_together import (
    CUBIC,
    FREE,
    GAINS,
    PD,
    coefficients,
    spline,
    together,
)

A = jb.actuation


@pytest.fixture(scope="module")
def six():
    return together(spline(6), coefficients(6))


@pytest.mark.slow
def test_a_bound_is_never_below_what_could_be_saved(six):
    gap, true = jb.optimise.torque_gap(six), six.objective - FREE
    assert true == pytest.approx(2.768e-5 * FREE, rel=1e-3)
    assert true <= gap.bound < 1.01 * true
    assert gap.error < 1e-8 * FREE
    assert gap.times[0] == 0.0
    assert gap.times[-1] < 0.7


@pytest.mark.slow
def test_the_hamiltonian_is_stationary_in_the_laws_own_torques(six):
    """∫ ∂H/∂u B dt is the derivative of the Lagrangian along each of the law's B-splines.

    Multipliers for which ∂H/∂u is least are nearly those of the law.
    """
    gap = jb.optimise.torque_gap(six)
    times = np.linspace(0.0, 0.7, 2001)
    slope = CubicSpline(gap.times, gap.switching["hip"])(times)
    zeros = tuple(np.zeros(6))
    for k in range(6):
        one = (*zeros[:k], 1.0, *zeros[k + 1 :])
        basis = np.asarray(A.TimeSpline(one, 0.7).torque_after(times))
        size = np.trapezoid(np.abs(slope) * basis, times)
        assert abs(np.trapezoid(slope * basis, times)) < 0.02 * size
    assert np.max(np.abs(slope)) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "vary", "most"),
    [
        pytest.param(CUBIC, coefficients(4), 1.001, id="cubic"),
        pytest.param(PD, GAINS, 1.001, id="controller"),
        pytest.param(spline(5), coefficients(5), 1.01, id="five", marks=pytest.mark.nightly),
        pytest.param(spline(8), coefficients(8), 1.01, id="eight", marks=pytest.mark.nightly),
        pytest.param(spline(12), coefficients(12), 1.1, id="twelve", marks=pytest.mark.nightly),
        pytest.param(spline(16), coefficients(16), 2.0, id="sixteen", marks=pytest.mark.nightly),
    ],
)
def test_bounds_are_close_for_any_law(scene, vary, most):
    best = together(scene, vary)
    gap = jb.optimise.torque_gap(best)
    assert best.objective - FREE <= gap.bound < most * (best.objective - FREE)


@pytest.mark.slow
def test_a_bound_per_length_where_the_speed_is_at_its_bound():
    """Period and step are free; twelve coefficients come near a torque that is free in time."""
    how = dict(subject_to=("speed>0.58", "step_length==0.4"), minimise="torque_squared_per_length")
    cubic, fine = (
        together(scene, vary, **how)
        for scene, vary in ((CUBIC, coefficients(4)), (spline(12), coefficients(12)))
    )
    saved = cubic.objective - fine.objective
    assert saved < jb.optimise.torque_gap(cubic).bound < 1.001 * saved


@pytest.mark.nightly
def test_knots_are_added_until_the_gap_is_small(six):
    found = jb.optimise.refine(six, gap=1e-7)
    assert [len(best.variables) for best in found.optima] == [6, 9, 15]
    assert found.best.objective == pytest.approx(FREE, rel=1e-7)
    assert str(found.best.outcome) == "converged"
    for best, gap in zip(found.optima, found.gaps, strict=True):
        assert best.objective - FREE <= gap.bound < 2.0 * (best.objective - FREE)
    assert found.gaps[-1].bound < 1e-7 * FREE < found.gaps[-2].bound


def test_half_the_intervals_make_the_same_function():
    law = A.TimeSpline(tuple(np.random.default_rng(0).standard_normal(7)), 0.7)
    finer, times = finer_spline(law), np.linspace(0.0, 0.7, 50)
    assert len(finer.torque) == 11
    np.testing.assert_allclose(finer.torque_after(times), law.torque_after(times), atol=1e-13)


@pytest.mark.slow
def test_what_has_no_bound_is_refused(six):
    with pytest.raises(jb.ArgumentError, match="the objective speed: it must be strictly convex"):
        jb.optimise.torque_gap(with_other_goal(six, ["speed"]))
    with pytest.raises(jb.ArgumentError, match="torque_gap is not allowed for peak_torque"):
        jb.optimise.torque_gap(with_other_goal(six, ["torque_squared", "peak_torque"]))
    passive = dataclasses.replace(six, scene=jb.models.goswami())
    with pytest.raises(jb.ArgumentError, match="a scene without a motor's law"):
        jb.optimise.torque_gap(passive)
    with pytest.raises(jb.ArgumentError, match="without a TimeSpline"):
        jb.optimise.refine(passive)
    tied = jb.optimise.Linear({"leg.hip.torque_1": 1.0})
    with pytest.raises(jb.ArgumentError, match="Linear sums of parameters"):
        jb.optimise.refine(with_other_goal(six, ["torque_squared", tied]))
    with pytest.raises(jb.ArgumentError, match="gap = 0"):
        jb.optimise.refine(six, gap=0.0)
