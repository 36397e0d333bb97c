"""Polynomials of a step, against NumPy's of the same coefficients and against known roots."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from jaxbiped.solve._step_polynomials import Quintic, StepCubic

STEP = 0.4
PLACES = np.linspace(0.0, 1.0, 7)


def cubic_of(curve):
    """From a polynomial of the share of the step."""
    slope = curve.deriv()
    return StepCubic(*map(jnp.asarray, (curve(0.0), curve(1.0), slope(0.0), slope(1.0))))


def quintic_of(curve):
    """From a polynomial of the share of the step; rates are those in time."""
    kinds = curve, curve.deriv() / STEP, curve.deriv(2) / STEP**2
    return Quintic.of(STEP, *([jnp.asarray(kind(end)) for kind in kinds] for end in (0.0, 1.0)))


def test_a_cubic_is_the_polynomial_that_its_ends_are_of():
    curve = Polynomial([0.7, -1.3, 0.4, 2.1])
    np.testing.assert_allclose(cubic_of(curve).at(PLACES), curve(PLACES), rtol=1e-14)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_cubic_changes_its_sign_where_it_has_its_root(sign):
    curve = sign * Polynomial.fromroots([0.37, 2.5, -1.2])
    place = float(cubic_of(curve).sign_change())
    assert place == pytest.approx(0.37, abs=1e-11)
    assert sign * curve(0.0) * sign * curve(place) <= 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("turns", [(0.3, 1.7), (0.3, -0.4), (0.3, 5.0), (1.2, 1.9), (-0.3, 1.4)])
def test_a_cubic_turns_where_its_slope_changes_sign(turns, sign):
    cubic = cubic_of(sign * Polynomial.fromroots(turns).integ(k=2.0))
    within = [turn for turn in turns if 0.0 < turn < 1.0]
    assert bool(cubic.turns()) == bool(within)
    assert float(cubic.turning_point()) == pytest.approx(*(within or [1.0]), rel=1e-12)


def test_what_turns_twice_within_a_step_is_not_said_to_turn():
    cubic = cubic_of(Polynomial.fromroots([0.3, 0.7]).integ(k=2.0))
    assert not bool(cubic.turns())
    assert float(cubic.turning_point()) == 1.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("lowest", "end", "touches"),
    [(0.05, 1.0, True), (0.15, 1.0, False), (-0.5, 1.0, True), (0.05, 0.25, False)],
)
def test_a_cubic_may_touch_zero_where_it_comes_near_it(lowest, end, touches, sign):
    """It begins at 1 and turns at a third; what is near is a tenth of the smaller end."""
    rises = Polynomial.fromroots([1 / 3, 1 / 3])
    fall = np.linalg.solve(
        [[rises(0.0), -1 / 27], [rises(1.0), 8 / 27]], [1.0 - lowest, end - lowest]
    )
    curve = lowest + fall[0] * rises + fall[1] * Polynomial.fromroots([1 / 3] * 3)
    np.testing.assert_allclose(curve(np.array([0.0, 1 / 3, 1.0])), [1.0, lowest, end])
    assert bool(cubic_of(sign * curve).may_touch()) == touches


def test_what_rises_or_ends_below_does_not_touch():
    for curve in (
        Polynomial([0.01, 1.0, -1.0]),
        Polynomial([0.01, -1.0, 0.5]),
        Polynomial([1.0, -0.5, -0.49]),
    ):
        assert not bool(cubic_of(curve).may_touch())


def test_a_quintic_is_the_polynomial_that_its_ends_are_of():
    curve = Polynomial([0.7, -1.3, 0.4, 2.1, -0.6, 0.9])
    value, slope, curvature = quintic_of(curve).derivatives(jnp.asarray(PLACES))
    np.testing.assert_allclose(value, curve(PLACES), rtol=1e-12)
    np.testing.assert_allclose(slope, curve.deriv()(PLACES), rtol=1e-12)
    np.testing.assert_allclose(curvature, curve.deriv(2)(PLACES), rtol=1e-12)


def test_control_values_are_those_of_bernsteins_form():
    """Of 1, s and s² they are 1, k/5 and k (k − 1)/20."""
    k = np.arange(6)
    for power, expected in enumerate((np.ones(6), k / 5, k * (k - 1) / 20)):
        control = quintic_of(Polynomial.basis(power)).control
        np.testing.assert_allclose(control, expected, atol=1e-15)


@pytest.mark.parametrize("others", [[2.0], [-1.0, 3.0], [1.5, 1.6, -0.5, 2.0]])
def test_a_quintic_falls_through_zero_at_its_root(others):
    curve = Polynomial.fromroots([0.3, *others])
    curve = curve if curve(0.0) > 0.0 else -curve
    assert float(quintic_of(curve).root()) == pytest.approx(0.3, abs=2e-4)


def test_newtons_method_that_leaves_the_part_with_the_root_halves_it():
    """It is nearly flat at first, where a tangent leads far beyond."""
    control = tuple(map(jnp.asarray, (1.0, 1.0, 1.0, 1.0, 1.0, -9.0)))
    assert float(Quintic(control).root()) == pytest.approx(0.1**0.2, abs=0.02)


def test_changes_of_sign_with_what_is_known_to_a_width():
    """Both ends count as they are; the first may count as what follows it."""
    control = tuple(map(jnp.asarray, (-0.05, 0.3, -0.1, 0.1, 0.3, 0.05)))
    quintic = Quintic(control)
    for shift, from_second, expected in (
        (0.0, False, 3),
        (0.0, True, 2),
        (0.2, False, 1),
        (0.2, True, 0),
        (-0.2, False, 3),
        (-0.2, True, 2),
        (-0.4, False, 1),
        (-0.4, True, 2),
    ):
        found = quintic.sign_changes(shift, from_second=jnp.asarray(from_second))
        assert int(found) == expected, (shift, from_second)
