"""Return maps, against an oscillator, a bouncing ball with drag and van der Pol's orbit."""

import functools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import jaxbiped as jb
from jaxbiped.hybrid import Switch
from tests.systems import Plain, map_of, orbit_near

pytestmark = pytest.mark.slow


class VanDerPol(Plain):
    def vector_field(self, t, y, args):
        return y[1], args * (1.0 - y[0] * y[0]) * y[1] - y[0]


class Oscillator(Plain):
    """x'' + 2 ζ ω x' + ω² x = 0, given as (x, v) and (ω, ζ)."""

    def vector_field(self, t, y, args):
        omega, zeta = args
        return y[1], -2.0 * zeta * omega * y[1] - omega * omega * y[0]


class Ball(Plain):
    """A ball in air with linear drag on a paddle: v⁺ = −e v⁻ + u at the ground."""

    def vector_field(self, t, y, args):
        drag, _, _ = args
        return y[1], -9.8 - drag * y[1]

    def reset_map(self, args, y):
        _, restitution, paddle = args
        return y[0], -restitution * y[1] + paddle


DOWN = jb.Section(lambda args, y: -y[0])
TURNING_POINT = jb.Section(lambda args, y: y[1])
MODES = {"forward": jb.gait.Forward(), "reverse": jb.gait.Reverse()}


def derivative(function, mode):
    return (jax.jacfwd if mode == "forward" else jax.jacrev)(function)


def value_and_derivative(function, mode):
    """Both of one solve, which compiles sooner than a plain one besides."""
    jacobian = jax.jacfwd if mode == "forward" else jax.jacrev

    def both(x):
        slopes, value = jacobian(lambda at: (function(at),) * 2, has_aux=True)(x)
        return value, slopes

    return both


def flight(drag, v):
    """Time of flight and speed at the ground of a ball thrown up at v, in closed form."""
    g, end = 9.8, 2.0 * v / 9.8

    def height(t):
        return (v + g / drag) * (1.0 - math.exp(-drag * t)) / drag - g * t / drag

    t = brentq(height, 1e-3 * end, 2.0 * end, xtol=1e-15, rtol=1e-14)
    return t, (v + g / drag) * math.exp(-drag * t) - g / drag


@pytest.mark.parametrize("engine", ["xla", "lanes"])
@pytest.mark.parametrize("mode", MODES)
def test_bouncing_ball_with_drag(mode, engine):
    v, args = 3.0, (0.3, 0.8, 1.0)

    def bounce(v, drag):
        r = jb.return_map(
            (drag, jnp.asarray(args[1]), jnp.asarray(args[2])),
            (jnp.asarray(0.0), v),
            section=DOWN,
            system=Ball(),
            gradient=MODES[mode],
            accuracy="tight",
            engine=engine,
        )
        return jnp.stack([r.state[1], r.time])

    time, speed = flight(0.3, v)
    reached, ours = value_and_derivative(lambda both: bounce(*both), mode)(jnp.array([v, 0.3]))
    assert reached == pytest.approx(np.array([-0.8 * speed + 1.0, time]), rel=1e-8)
    # By the implicit function theorem on the closed form of the height.
    h = 1e-5
    for column, (dv, dk) in enumerate(((h, 0.0), (0.0, h))):
        t1, s1 = flight(0.3 + dk, v + dv)
        t0, s0 = flight(0.3 - dk, v - dv)
        expected = np.array([-0.8 * (s1 - s0), t1 - t0]) / (2 * h)
        assert np.asarray(ours)[:, column] == pytest.approx(expected, rel=2e-6)


OMEGA, ZETA = 2.0, 0.1
ROOT = math.sqrt(1.0 - ZETA**2)
FACTOR, PERIOD = math.exp(-2 * math.pi * ZETA / ROOT), 2 * math.pi / (OMEGA * ROOT)
"""From a crossing of x = 0 downwards to the next: v → v exp(−2π ζ/√(1−ζ²)), and the time."""


@pytest.mark.parametrize("engine", ["xla", "lanes"])
@pytest.mark.parametrize("solver", ["rodas3p", "rodas4p", "rodas5p"])
def test_every_solver_carries_derivatives(solver, engine):
    def turned(v):
        start = (jnp.asarray(0.0), v)
        how = dict(section=DOWN, system=Oscillator(), gradient=jb.gait.Forward())
        args = (jnp.asarray(OMEGA), jnp.asarray(ZETA))
        r = jb.return_map(args, start, solver=solver, engine=engine, **how)
        return r.state[1]

    reached, slope = jax.jvp(turned, (jnp.asarray(-1.5),), (jnp.asarray(1.0),))
    assert float(reached) == pytest.approx(-1.5 * FACTOR, rel=1e-5)
    assert float(slope) == pytest.approx(FACTOR, rel=1e-4)


class Spring(NamedTuple):
    omega: Any
    zeta: Any


@pytest.mark.parametrize("engine", ["xla", "lanes"])
def test_a_linearised_turn_of_the_oscillator(engine):
    start = (jnp.asarray(0.0), jnp.asarray(-1.5))
    found = jb.gait.linearise_return_map(
        Spring(OMEGA, ZETA), start, rtol=1e-9, tangent_rtol=1e-8, parameters=("zeta", "omega"),
        section=DOWN, system=Oscillator(), engine=engine,
    )  # fmt: skip
    assert float(found.recurring[1]) == pytest.approx(-1.5 * FACTOR, rel=1e-7)
    assert float(found.period) == pytest.approx(PERIOD, rel=1e-7)
    by_zeta = -2 * math.pi / ROOT**3 * -1.5 * FACTOR
    ours = np.asarray(found.jacobian)[1, 1:]
    assert ours == pytest.approx([FACTOR, ZETA * by_zeta, 0.0], rel=1e-5, abs=1e-6)
    times = np.asarray(found.period_row)[1:]
    assert times == pytest.approx([0.0, PERIOD * ZETA**2 / ROOT**2, -PERIOD], rel=1e-5, abs=1e-6)
    # Liouville: areas shrink by the field's divergence.
    area = np.linalg.det(np.asarray(found.monodromy)[:, :2])
    assert area == pytest.approx(math.exp(-2 * ZETA * OMEGA * PERIOD), rel=1e-5)


@pytest.mark.parametrize("engine", ["xla", "lanes"])
def test_van_der_pol_multiplier_and_its_sensitivities(engine):
    """λ = exp(∮ μ (1 − x²) dt); period, amplitude and λ against SciPy, and their derivatives."""

    def reference(mu):
        def rates(t, y):
            f = mu * (1.0 - y[0] ** 2)
            return [y[1], f * y[1] - y[0], f]

        y = np.array([-2.0, 0.0])
        crossing = lambda t, y: y[1]
        crossing.direction = 1.0
        for _ in range(12):
            s = solve_ivp(
                rates, (0.0, 9.0), [*y, 0.0], "DOP853", events=crossing, rtol=1e-13, atol=1e-14
            )
            k = int(np.flatnonzero(s.t_events[0] > 1.0)[0])
            y, total, period = s.y_events[0][k][:2], s.y_events[0][k][2], s.t_events[0][k]
        return np.array([y[0], period, math.exp(total)])

    spec = map_of(VanDerPol(), TURNING_POINT, engine=engine)
    orbit = jax.jit(lambda mu: orbit_near(spec, mu, (jnp.asarray(-2.1), jnp.asarray(0.1))))(
        jnp.asarray(1.0)
    )
    expected = reference(1.0)
    slopes = (reference(1.001) - reference(0.999)) / 0.002
    assert int(orbit.found.ending) == 0
    assert float(orbit.state[0]) == pytest.approx(expected[0], rel=1e-8)
    assert float(orbit.found.last.period) == pytest.approx(expected[1], rel=1e-8)
    assert float(orbit.stability.spectral_radius) == pytest.approx(expected[2], rel=1e-5)
    assert float(orbit.stability.unit_error) < 1e-6
    assert float(orbit.slopes.recurring[0, 0]) == pytest.approx(slopes[0], rel=1e-5)
    assert float(orbit.slopes.period[0]) == pytest.approx(slopes[1], rel=1e-5)
    assert float(orbit.radius_slopes[0]) == pytest.approx(slopes[2], rel=1e-4)


def test_bouncing_ball_in_a_cycle_of_two():
    """A fixed point, by lanes, is a cycle of two as well, by XLA: multiplier and period follow."""
    args = tuple(jnp.asarray(value) for value in (0.3, 0.8, 1.0))
    found = []
    for steps, engine in ((1, "lanes"), (2, "xla")):
        spec = map_of(Ball(), DOWN, steps=steps, engine=engine)
        guess = (jnp.asarray(0.0), jnp.asarray(4.0))
        found.append(jax.jit(functools.partial(orbit_near, spec))(args, guess))
    once, twice = found
    assert float(twice.found.last.period) == pytest.approx(2 * float(once.found.last.period))
    one, two = (float(orbit.found.last.jacobian[1, 1]) for orbit in found)
    assert two == pytest.approx(one**2, rel=1e-5)
    for leaf in ("recurring", "period"):
        a, b = (np.asarray(getattr(orbit.slopes, leaf)) for orbit in found)
        assert b == pytest.approx(a * (2.0 if leaf == "period" else 1.0), rel=1e-5, abs=1e-6)
    # The radius of two is that of one, squared.
    expected = 2.0 * one * np.asarray(once.radius_slopes)
    np.testing.assert_allclose(np.asarray(twice.radius_slopes), expected, rtol=1e-4, atol=1e-7)


def test_modes_that_do_not_fit_are_refused():
    state, args = (jnp.asarray(0.0), jnp.asarray(3.0)), (0.3, 0.8, 1.0)

    def bounce(v, gradient, engine="auto"):
        start = (state[0], v)
        how = dict(section=DOWN, system=Ball(), engine=engine)
        return jb.return_map(args, start, gradient=gradient, **how).time

    with pytest.raises(jb.ArgumentError, match="Implicit"):
        bounce(state[1], jb.gait.Implicit())
    with pytest.raises(RuntimeError, match="no reverse mode"):
        jax.eval_shape(jax.grad(lambda v: bounce(v, jb.gait.Forward())), state[1])
    for engine in ("xla", "lanes"):
        reversible = functools.partial(bounce, gradient=jb.gait.Reverse(), engine=engine)
        with pytest.raises(TypeError, match="forward-mode"):
            jax.jvp(reversible, (state[1],), (state[1],))


def test_what_does_not_return_says_so():
    """In a second, or in as many periods as there are steps for."""
    up = jb.Section(lambda args, y: y[0] - 100.0)
    args = (2.0, 0.0)
    state = (jnp.asarray(0.0), jnp.asarray(3.0))
    for time, ending in ((1.0, jb.Ending.TIMED_OUT), (1e9, jb.Ending.OUT_OF_STEPS)):
        for engine in ("lanes", "xla"):
            options = dict(section=up, system=Oscillator(), max_time=time, engine=engine)
            found = jb.return_map(args, state, **options)
            assert jb.Ending(int(found.code)) is ending


class Held(Plain):
    """The oscillator with its frequency as a field, given ζ alone."""

    omega: Any

    def vector_field(self, t, y, args):
        return Oscillator().vector_field(t, y, (self.omega, args))


class Level(jb.hybrid.AbstractSection):
    """Upwards through a level of the velocity."""

    level: Any

    def value(self, args, y):
        return y[1] - self.level

    def counts(self, args, y):
        return jnp.asarray(True)


def _swung(omega, zeta, section=TURNING_POINT, **options):
    start = (jnp.asarray(1.0), jnp.asarray(0.0))
    return jb.return_map(zeta, start, section=section, system=Held(omega), **options).time


def test_a_system_may_hold_a_number_and_by_xla_an_array():
    zeta = jnp.asarray(0.1)
    exact = math.pi / (2.0 * math.sqrt(1.0 - 0.01))
    assert float(_swung(jnp.asarray(2.0), zeta)) == pytest.approx(exact, rel=1e-6)
    assert float(_swung(2.0, zeta, engine="lanes")) == pytest.approx(exact, rel=1e-6)
    slope = jax.jacfwd(lambda z: _swung(jnp.asarray(2.0), z))(zeta)
    assert float(slope) == pytest.approx(exact * 0.1 / 0.99, rel=1e-5)


def test_what_systems_and_sections_hold_is_refused_where_it_would_not_be_seen():
    """By lanes, in reverse mode, and where it is differentiated: before anything is compiled."""
    omega, zeta = jnp.asarray(2.0), jnp.asarray(0.1)
    with pytest.raises(jb.ArgumentError, match='"lanes" is not allowed here: the system Held'):
        _swung(omega, zeta, engine="lanes")
    with pytest.raises(jb.ArgumentError, match="Held holds arrays, which belong in args"):
        _swung(omega, zeta, gradient=jb.gait.Reverse())
    with pytest.raises(jb.ArgumentError, match="Level holds arrays, which belong in args"):
        _swung(2.0, zeta, section=Level(omega), gradient=jb.gait.Reverse())
    with pytest.raises(jb.ArgumentError, match=r"Held or .* must be among args"):
        jax.jacfwd(lambda held: _swung(held, zeta))(omega)
    with pytest.raises(jb.ArgumentError, match=r"or Level holds .* must be among args"):
        jax.jacfwd(lambda level: _swung(2.0, zeta, section=Level(level)))(zeta)


class Step(Plain):
    """A force that jumps: y'' = −a above the ground y = s, and +b below it; given as (a, b, s)."""

    def vector_field(self, t, y, args):
        a, b, ground = args
        return y[1], jnp.where(y[0] > ground, -a, b)

    def switches(self, args, y):
        return (Switch(y[0] - args[2], True, force_jumps=True),)


@pytest.mark.parametrize(
    ("mode", "engine"),
    [
        ("forward", "xla"),
        ("forward", "lanes"),
        pytest.param("reverse", "xla", marks=pytest.mark.nightly),
        ("reverse", "lanes"),
    ],
)
def test_derivatives_leap_where_the_force_jumps(mode, engine):
    """Dropped from y, it turns (y − s) a/b below the ground, after (1 + a/b) √(2 (y − s)/a)."""

    def turned(numbers):
        y, a, b, ground = numbers
        r = jb.return_map(
            (a, b, ground),
            (y, jnp.zeros_like(y)),
            section=TURNING_POINT,
            system=Step(),
            gradient=MODES[mode],
            accuracy="tight",
            engine=engine,
        )
        return jnp.stack([r.state[0], r.time])

    def truth(numbers):
        y, a, b, ground = numbers
        fall = y - ground
        return jnp.stack([ground - fall * a / b, (1.0 + a / b) * jnp.sqrt(2.0 * fall / a)])

    at = jnp.array([1.3, 0.9, 3.0, 0.2])
    assert np.asarray(turned(at)) == pytest.approx(np.asarray(truth(at)), rel=1e-8)
    ours, expected = derivative(turned, mode)(at), jax.jacfwd(truth)(at)
    assert np.asarray(ours) == pytest.approx(np.asarray(expected), rel=1e-6, abs=1e-8)


@pytest.mark.parametrize(("mode", "said"), [("forward", "Forward"), ("reverse", "across switches")])
def test_second_derivatives_that_steps_do_not_see_are_refused(mode, said):
    """Steps end where the switches were: what these add to second derivatives would be missing."""

    def turned(y):
        given = (jnp.asarray(0.9), jnp.asarray(3.0), jnp.asarray(0.2)), (y, jnp.zeros_like(y))
        how = dict(section=TURNING_POINT, system=Step(), gradient=MODES[mode], engine="xla")
        return jb.return_map(*given, **how).time

    with pytest.raises(jb.ArgumentError, match=f"Second derivatives of a return map .*{said}"):
        jax.jacfwd(derivative(turned, mode))(jnp.asarray(1.3))


class Pad(Plain):
    """Nothing acts above y = s; below, w' = −b (s − y)^¼ w brakes what comes down; given (b, s)."""

    def vector_field(self, t, y, args):
        brake, level = args
        depth = jnp.where(y[0] < level, level - y[0], 1.0)
        return y[1], jnp.where(y[0] < level, -brake * depth**0.25 * y[1], 0.0)

    def switches(self, args, y):
        return (Switch(args[1] - y[0], True),)


@pytest.mark.parametrize("engine", [pytest.param("xla", marks=pytest.mark.nightly), "lanes"])
@pytest.mark.parametrize("mode", MODES)
def test_derivatives_where_the_force_is_infinitely_steep(mode, engine):
    """Tsuji's kind: at depth δ the speed is u − 0.8 b δ^(5/4), from whatever height."""

    def arrived(numbers):
        y, speed, brake, level = numbers
        r = jb.return_map(
            (brake, level),
            (y, -speed),
            section=jb.Section(lambda args, y: -y[0]),
            system=Pad(),
            gradient=MODES[mode],
            engine=engine,
        )
        return jnp.stack([-r.state[1], r.time])

    def truth(numbers):
        y, speed, brake, level = numbers
        at, weights = np.polynomial.legendre.leggauss(40)
        root = 0.5 * level**0.25 * (1.0 + at)
        falls = jnp.sum(4.0 * root**3 / (speed - 0.8 * brake * root**5) * weights)
        below = 0.5 * level**0.25 * falls
        return jnp.stack([speed - 0.8 * brake * level**1.25, (y - level) / speed + below])

    at = jnp.array([0.3, 2.0, 8.0, 0.1])
    assert np.asarray(arrived(at)) == pytest.approx(np.asarray(truth(at)), rel=1e-6)
    ours, expected = derivative(arrived, mode)(at), jax.jacfwd(truth)(at)
    assert np.asarray(ours) == pytest.approx(np.asarray(expected), rel=2e-5, abs=2e-5)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (dict(rtol=0.0), "rtol = 0 is not allowed"),
        (dict(tangent_rtol=-1.0), "tangent_rtol = -1 is not allowed"),
        (dict(parameters=("K2",)), "parameters = 'K2' is not known"),
        (dict(max_time=0.0), "max_time = 0 is not allowed"),
        (dict(footsteps=0), "footsteps = 0 is not allowed"),
        (dict(max_solver_steps=0), "max_solver_steps = 0 is not allowed"),
        (dict(args=jb.RedundantScene(jb.seed_scene())), "args = a RedundantScene"),
    ],
)
def test_what_a_linearised_return_is_refused(change, said):
    how = dict(args=jb.seed_scene(), state=jb.seed_state(), rtol=1e-6, tangent_rtol=1e-5) | change
    with pytest.raises(jb.ArgumentError) as refused:
        jb.gait.linearise_return_map(how.pop("args"), how.pop("state"), **how)
    assert said in str(refused.value)
