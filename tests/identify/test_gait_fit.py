"""What residuals tell of parameters, against linear least squares."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.identify import MeasuredGait
from jaxbiped.identify._fit_gait import Descent, _check_measured
from jaxbiped.identify._gait_fit import information
from tests.mechanisms import WALKERS

EXACT = np.zeros((6, 3))


def test_covariance_is_that_of_least_squares():
    slopes = np.random.default_rng(1).standard_normal((6, 3)) * [1e3, 5.0, 1e6]
    found = information(slopes, EXACT)
    assert not found.undetermined.any()
    np.testing.assert_allclose(found.covariance, np.linalg.inv(slopes.T @ slopes), rtol=1e-8)


def test_what_others_make_up_for_is_undetermined():
    slopes = 100.0 * np.random.default_rng(2).standard_normal((6, 3))
    slopes[:, 2] = 2.0 * slopes[:, 1]
    found = information(slopes, EXACT)
    np.testing.assert_array_equal(found.undetermined, [False, True, True])
    assert found.rank == 2
    # Whatever the other two are together, the first is told beside them.
    both = slopes[:, :2]
    assert np.isclose(found.covariance[0, 0], np.linalg.inv(both.T @ both)[0, 0])


def test_what_noise_determines_is_undetermined():
    """Two columns that differ by less than their own errors, one that stands apart."""
    random = np.random.default_rng(4)
    slopes = 100.0 * random.standard_normal((6, 3))
    slopes[:, 2] = slopes[:, 1] + 0.01 * random.standard_normal(6)
    errors = EXACT.copy()
    assert not information(1e6 * slopes, errors).undetermined.any()
    errors[:, 1:] = 0.02
    np.testing.assert_array_equal(
        information(1e6 * slopes, 1e6 * errors).undetermined, [False, True, True]
    )


def test_what_errors_may_turn_into_a_direction_is_still_told():
    """The last two make up for each other but for a hundredth of the first column, which its own
    errors of two hundredths may hide: the first is told, unless it is known without errors."""
    slopes = 100.0 * np.linalg.qr(np.random.default_rng(5).standard_normal((6, 3)))[0]
    slopes[:, 2] = slopes[:, 1] + 0.01 * slopes[:, 0]
    errors = EXACT.copy()
    assert information(slopes, errors).undetermined.all()
    errors[0, 0] = 2.0
    np.testing.assert_array_equal(information(slopes, errors).undetermined, [False, True, True])


def test_a_derivative_below_its_own_error_tells_nothing():
    slopes = 100.0 * np.random.default_rng(3).standard_normal((6, 3))
    errors = EXACT.copy()
    errors[:, 1] = 60.0
    np.testing.assert_array_equal(information(slopes, errors).undetermined, [False, True, False])


def test_a_wide_error_is_dropped_and_the_rest_stays():
    slopes = np.diag([100.0, 0.1, 50.0])
    found = information(slopes, np.zeros((3, 3)))
    np.testing.assert_array_equal(found.undetermined, [False, True, False])
    assert np.isclose(found.covariance[2, 2], 1.0 / 2500.0)


def test_nothing_measured_tells_nothing():
    assert information(np.zeros((4, 2)), np.zeros((4, 2))).undetermined.all()


@pytest.mark.parametrize(
    ("bounds", "value", "variable"),
    [
        ((0.2, 0.8), 0.5, np.log(0.5 / 0.4)),
        ((0.2, np.inf), 0.5, np.log(0.5 / 0.4)),
        ((-np.inf, np.inf), 0.5, np.log(0.5 / 0.4)),
        ((0.0, 0.8), 0.5, 0.1 / 0.8),
        ((-0.2, 0.8), -0.1, -0.5 / 1.0),
    ],
)
def test_a_parameter_is_varied_by_its_logarithm_unless_its_bounds_hold_zero(
    bounds, value, variable
):
    """The leg's length, 0.4 m; between bounds that hold zero in units of their distance."""
    scene = jb.ladder()["rigid"]
    measured = [MeasuredGait({"period": (0.44, 1e-3)})]
    fit = Descent(scene, {"l": bounds}, measured, "balanced", "lanes", None)
    assert fit.variables(np.array([value])) == pytest.approx([variable])
    assert fit.parameters(np.array([variable]))["l"] == pytest.approx(value)


UNEQUAL = jb.RigidScene(walker=WALKERS["unequal"], ground=jb.Ground(slope=0.02))
"""A walker whose cycle has two footsteps."""


@pytest.mark.parametrize(
    ("measures", "footsteps", "said"),
    [
        ({"state_omega_leg_2": (-1.0, 0.1), "state_theta_leg_1": (-0.2, 0.01)}, None, None),
        ({"state_omega_9": (-1.0, 0.1)}, None, "'state_omega_9' is not known"),
        ({"period": (0.88, 1e-3)}, 4, None),
        ({"period": (0.88, 1e-3)}, 3, "footsteps = 3 is not allowed: a cycle of this walker has 2"),
    ],
)
def test_a_measured_gait_is_of_the_scenes_own_states_and_cycles(measures, footsteps, said):
    check = lambda: _check_measured(UNEQUAL, MeasuredGait(measures, footsteps=footsteps), {})
    if said is None:
        check()
    else:
        with pytest.raises(jb.ArgumentError, match=re.escape(said)):
            check()


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("beyond", [True, False])
@pytest.mark.parametrize("off", [0.0, 0.5e-4, 2e-4])
def test_a_parameter_is_at_a_bound_that_it_is_pushed_against(place, beyond, off):
    """Of an error of a tenth: within a ten-thousandth of the bound, and better off beyond it."""
    outwards = (-1.0, 1.0)[place]
    fit = SimpleNamespace(limits=np.array([[-0.3, -np.inf], [0.7, np.inf]]))
    at = np.array([fit.limits[place, 0] - outwards * off, 0.0])
    slopes = np.array([[10.0, 0.0], [0.0, 10.0]])
    residuals = np.array([(-1.0 if beyond else 1.0) * outwards, 3.0])
    found = Descent._at_bounds(fit, at, residuals, slopes)
    assert found.tolist() == [beyond and off < 1e-4, False]
