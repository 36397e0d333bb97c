"""Laws of time, limits and virtual constraints alone, against formulas and splines of SciPy."""

import dataclasses
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BSpline

import jaxbiped as jb
from tests.mechanisms import FEET, LEGS, PAIR, TORSO

A = jb.actuation
SEED = jb.seed_scene()
COEFFICIENTS = (0.4, -0.2, 0.3, 0.1, -0.5, 0.2)
HIP = A.HipMotion((-0.2, 0.1), (1.3, -1.1), (0.25, 0.7))
TIMES = np.linspace(0.0, 1.0, 21)


def at(**values):
    """What a law may know of a motion."""
    known = {name: jnp.asarray(value) for name, value in values.items()}
    return SimpleNamespace(**known)


def splined(coefficients, first, last, places):
    """By SciPy, on equidistant knots, and its slope; between the first place and the last."""
    count = len(coefficients)
    knots = first + (last - first) / (count - 3) * np.arange(-3.0, count + 1.0)
    spline = BSpline(knots, coefficients, 3)
    return spline(places), spline(places, 1)


def test_a_polynomial_of_time_stays_beyond_its_span():
    law = A.TimePolynomial((2.0, 6.0, -5.0), span=0.7)
    expected = np.polyval([-5.0, 6.0, 2.0], np.minimum(TIMES, 0.7) / 0.7)
    found = [law(at(time=time)) for time in TIMES]
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    assert float(A.TimePolynomial(1.5, span=0.7)(at(time=0.4))) == 1.5


def test_a_spline_of_time_is_scipys_and_stays_beyond_its_span():
    law = A.TimeSpline(COEFFICIENTS, span=0.6)
    expected, _ = splined(COEFFICIENTS, 0.0, 0.6, np.minimum(TIMES, 0.6))
    np.testing.assert_allclose([law(at(time=time)) for time in TIMES], expected, atol=1e-14)
    same = A.TimeSpline((0.3,) * 7, span=0.6)
    np.testing.assert_allclose([same(at(time=time)) for time in TIMES], 0.3, rtol=1e-13)


@pytest.mark.parametrize("law", [A.PD(2.0, 0.3), A.HipSpline((0.3, 0.2)), lambda m: m.angle])
def test_a_limit_saturates_any_law_smoothly(law):
    motion = at(angle=0.4, rate=-1.0, phase=0.1)
    plain = float(law(motion))
    for most in (0.1, 1.0, 1e6):
        limited = A.Limited(law, most=most)
        assert float(limited(motion)) == pytest.approx(most * np.tanh(plain / most), rel=1e-12)
    assert float(A.Limited(law, 1e6)(motion)) == pytest.approx(plain, rel=1e-10)


def test_a_limited_law_acts_at_the_hip_as_the_law_does():
    for law in (A.HipSpline((0.3, 0.2)), A.HipTorque(0.2, reaction="trunk")):
        np.testing.assert_allclose(A.Limited(law, 1e6).torques(HIP), law.torques(HIP), rtol=1e-9)
    between = A.Limited(lambda motion: -0.1 * motion.angle - 0.01 * motion.rate, 1e6).torques(HIP)
    spring = A.HipSpring(k=0.1, b=0.01).torques(A.HipMotion(HIP.angle, HIP.rate, (None, 1.0)))
    one = A.HipMotion(HIP.angle, HIP.rate, (None, jnp.ones(())))
    alone = A.Limited(lambda motion: -0.1 * motion.angle - 0.01 * motion.rate, 1e6).torques(one)
    np.testing.assert_allclose(alone, spring, rtol=1e-9)
    assert not np.allclose(between, alone)
    with pytest.raises(jb.ArgumentError, match=r"motion\.of\('thigh_1'\) is not allowed for an"):
        A.Limited(A.PD(1.0, of="thigh_1"), 1.0).torques(one)


def test_idle_laws_do_nothing():
    timed = HIP.timed(jnp.asarray(0.2))
    for law in (A.TimePolynomial((1.0, 2.0), 0.5), A.TimeSpline((1.0,) * 4, 0.5)):
        assert np.any(law.torques(timed))
        assert not np.any(law.idle().torques(timed))
        assert not np.any(A.Limited(law, 3.0).idle().torques(timed))
    assert np.max(np.abs(A.Limited(lambda motion: 1.0, 3.0).idle().torques(HIP))) < 1e-5


def test_a_virtual_constraint_holds_an_output_on_a_function_of_the_phase():
    law = A.VirtualConstraint(3.0, 0.5, output=COEFFICIENTS, first=-0.2, last=0.4)
    for phase in (-0.15, 0.0, 0.33):
        value, slope = splined(COEFFICIENTS, -0.2, 0.4, phase)
        motion = at(angle=0.1, rate=0.7, phase=phase, phase_rate=1.2)
        expected = -3.0 * (0.1 - value) - 0.5 * (0.7 - slope * 1.2)
        assert float(law(motion)) == pytest.approx(expected, rel=1e-12)
    for phase, end in ((-0.5, -0.2), (0.9, 0.4)):
        value, slope = splined(COEFFICIENTS, -0.2, 0.4, end)
        motion = at(angle=0.1, rate=0.7, phase=phase, phase_rate=1.2)
        expected = -3.0 * (0.1 - value - slope * (phase - end)) - 0.5 * (0.7 - slope * 1.2)
        assert float(law(motion)) == pytest.approx(expected, rel=1e-12)
    same = A.VirtualConstraint(3.0, 0.5, output=(0.1,) * 5, first=-0.2, last=0.2)
    motion = at(angle=0.3, rate=0.7, phase=0.6, phase_rate=1.2)
    assert float(same(motion)) == pytest.approx(float(A.PD(3.0, 0.5, 0.1)(motion)), rel=1e-12)


def test_a_torso_on_a_constant_function_is_one_that_a_controller_holds():
    def walked(law):
        motor = jb.Motor({"torso": 1, "leg_2": -1}, law)
        walker = jb.Mechanism(bodies=(*LEGS, TORSO), feet=FEET, joints=(motor,), mirror=PAIR)
        scene = jb.RigidScene(walker, jb.Ground(slope=0.02))
        start = scene.state(theta_leg_1=-0.2, theta_leg_2=0.2, omega_leg_2=-1.2)
        return np.stack(jb.rigid_walk(scene, start, duration=0.3).state)

    upright = {"torso": 1, "normal": -1}
    held = A.VirtualConstraint(4.0, 0.4, output=(0.05,) * 5, first=-0.1, last=0.1, of=upright)
    expected = walked(A.PD(4.0, 0.4, 0.05, of=upright))
    np.testing.assert_allclose(walked(held), expected, atol=1e-9)
    np.testing.assert_allclose(walked(A.Limited(held, 1e5)), expected, atol=1e-7)
    assert not np.allclose(walked(A.Limited(held, 0.05)), expected, atol=1e-4)


def test_numbers_of_the_laws_are_parameters():
    law = A.Limited(A.TimeSpline((0.1, 0.2, 0.3, 0.4), 0.5), most=2.0)
    scene = jb.RigidScene(SEED.walker, SEED.ground, law)
    own = jb.parameter_names(scene)[-6:]
    assert own == ("torque_1", "torque_2", "torque_3", "torque_4", "span", "most")
    assert float(jb.parameter_values(jb.with_parameters(scene, {"span": 0.6}))["span"]) == 0.6
    slopes = jax.grad(lambda law: jnp.sum(law.torques(HIP.timed(jnp.asarray(0.9)))[0]))(law)
    assert np.all(np.isfinite(jax.tree.leaves(slopes)))


def test_only_a_law_that_reads_the_time_gives_a_scene_a_clock():
    names = jb.RigidScene(SEED.walker, SEED.ground).state_names
    for law in (A.HipSpline((0.1, 0.2)), A.Limited(lambda motion: motion.phase, 1.0)):
        assert jb.RigidScene(SEED.walker, SEED.ground, law).state_names == names
    for law in (A.TimePolynomial(0.1, 0.4), A.Limited(lambda motion: motion.time, 1.0)):
        assert jb.RigidScene(SEED.walker, SEED.ground, law).state_names == (*names, "clock")
        timed = dataclasses.replace(SEED, actuation=(A.HipTorque(0.1), law))
        assert timed.state_names == (*SEED.state_names, "clock", "strike_leg")


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: A.TimePolynomial((), 0.7), "torque has length 0, .* give one or more coeff"),
        (lambda: A.TimeSpline((1.0,) * 3, 0.7), "torque has length 3, .* give four or more coeff"),
        (
            lambda: A.TimeSpline((1.0,) * 4, 0.0),
            "span = 0 is not allowed: it must be .* above 0 s",
        ),
        (lambda: A.TimePolynomial(1.0, -1.0), "span = -1 is not allowed"),
        (lambda: A.TimePolynomial(1.0, np.nan), "span = nan is not allowed"),
        (lambda: A.TimePolynomial(1.0, 0.7, reaction="arm"), "reaction = 'arm' is not"),
        (lambda: A.Limited(A.PD(1.0), 0.0), "most = 0 is not allowed"),
        (lambda: A.Limited(3.0, 1.0), "law = 3.* is not allowed for Limited: give a law"),
        (lambda: A.Limited(A.HipSpring(1.0), 1.0), "HipSpring.* is not allowed for Limited"),
        (
            lambda: A.VirtualConstraint(1.0, 1.0, (0.1,) * 3, -0.2, 0.2),
            "output has length 3, .* give four or more coefficients",
        ),
        (
            lambda: A.VirtualConstraint(1.0, 1.0, (0.1,) * 4, 0.2, 0.2),
            r"last = 0\.2 is not allowed with first = 0\.2",
        ),
    ],
)
def test_bad_numbers_are_refused_in_a_sentence(make, told):
    with pytest.raises(jb.ArgumentError, match=told):
        make()
