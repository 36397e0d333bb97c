"""Polynomials of a step against NumPy's and known roots; Runge–Kutta steppers against diffrax's."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from jaxbiped.hybrid._scales import Units
from jaxbiped.solve._recorders import arrival_time
from jaxbiped.solve._runge_kutta import dense_rows, stepper_of, weights_of
from jaxbiped.solve._solvers import SOLVERS, with_root_tolerances
from jaxbiped.solve._step_polynomials import Quintic, StepCubic
from jaxbiped.solve._stepper import Tolerance

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


EXPLICIT = [diffrax.Heun, diffrax.Bosh3, diffrax.Tsit5, diffrax.Dopri5, diffrax.Dopri8]
STIFFNESS = jnp.asarray(900.0)
ENDS = jnp.asarray(0.0), jnp.asarray(0.01)


def field(t, y, stiffness):
    place, speed = y
    return speed, -stiffness * jnp.sin(place) - speed + jnp.cos(t)


@pytest.mark.parametrize("kind", [*EXPLICIT, diffrax.Euler])
def test_dense_output_is_diffraxs(kind):
    weights = jnp.asarray(weights_of(kind).end)
    increments = jax.random.normal(jax.random.key(1), weights.shape)
    ends = dict(t0=1.0, t1=1.5, y0=jnp.asarray(0.3), y1=0.3 + weights @ increments)
    stages = {} if kind is diffrax.Euler else {"k": increments}
    expected = kind.interpolation_cls(**ends, **stages)
    coefficients = tuple(jnp.asarray(dense_rows(kind)) @ increments)
    found = stepper_of(kind()).interpolation_cls(**ends, coefficients=coefficients)
    times = jnp.linspace(1.0, 1.5, 11)
    states = (jax.vmap(course.evaluate)(times) for course in (found, expected))
    np.testing.assert_allclose(*states, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["euler", "runge2", "tsit5", "dopri8", "kvaerno3", "kvaerno5"])
def test_a_step_is_diffraxs(name):
    """Of a nonlinear equation, in which the rate of one component is another component."""
    start, term = (jnp.asarray(1.0), jnp.asarray(0.2)), diffrax.ODETerm(field)
    tolerance = Tolerance(1e-11, 1e-11, Units((1.0, 1.0), 1.0))
    found = stepper_of(SOLVERS[name]()).advance(term, *ENDS, start, STIFFNESS, tolerance)
    solver = with_root_tolerances(SOLVERS[name](), jnp.asarray(1e-11), jnp.asarray(1e-11))
    begun = solver.init(term, *ENDS, start, STIFFNESS)
    end, error, *_ = solver.step(term, *ENDS, start, STIFFNESS, begun, False)
    np.testing.assert_allclose(found.end, end, rtol=1e-11)
    assert (found.error is None) == (error is None)
    if error is not None:
        np.testing.assert_allclose(found.error, error, rtol=0.0, atol=1e-11)


def test_a_stage_that_is_not_found_makes_the_error_infinite():
    """Of many turns in a step, by iterations with the Jacobian at its start."""
    start, term = (jnp.asarray(0.0), jnp.asarray(1e3)), diffrax.ODETerm(field)
    tolerance = Tolerance(1e-10, 1e-10, Units((1.0, 1.0), 1.0))
    found = stepper_of(SOLVERS["kvaerno3"]()).advance(term, 0.0, 1.0, start, STIFFNESS, tolerance)
    assert np.all(np.isinf(found.error))


@pytest.mark.parametrize(
    "solver",
    [
        diffrax.HalfSolver(diffrax.Tsit5()),
        diffrax.ImplicitEuler(),
        diffrax.Kvaerno3(root_finder=diffrax.VeryChord(rtol=1e-3, atol=1e-3)),
    ],
)
def test_other_solvers_have_no_stepper(solver):
    assert stepper_of(solver) is None


@pytest.mark.parametrize(
    ("curve", "end"), [(lambda x: x * x - 0.25, 2.0), (lambda x: 0.25 - (2.0 - x) ** 2, 0.0)]
)
def test_an_end_that_stays_twice_counts_half(curve, end):
    """The Illinois method over [0, 2]: Dowell and Jarratt, "A modified regula falsi method", BIT 11
    (1971) 168. On the side of this end no chord meets zero."""
    asked = []
    with jax.disable_jit():
        arrival_time(
            lambda x: asked.append(float(x)) or curve(x), jnp.asarray(0.0), jnp.asarray(2.0)
        )
    near = 2.0 - end
    for share, found in zip((1.0, 1.0, 0.5, 0.25), asked[2:], strict=False):
        there = share * curve(end)
        near = near - curve(near) * (end - near) / (there - curve(near))
        assert found == pytest.approx(near, rel=1e-14)
