"""Motions that motors see, against derivatives, trigonometry and the mirror's own exchange."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._trigonometry import angle_of_vector
from jaxbiped.dynamics._actuation import MotorMotion, exchanged, motor_torque, motor_torques
from jaxbiped.dynamics._contacts import legs_in
from jaxbiped.dynamics._energy import motor_powers
from jaxbiped.dynamics._tree import Motion, pose_of
from tests.scene.test_mechanism import BISECTING, LEGS, TORSO, kneed, two_legs

LEANING = {"torso": 1, "vertical": -1}


def motion_with(angles, rates):
    return Motion(
        0.3, 0.4, 0.1, -0.2, tuple(map(jnp.asarray, angles)), tuple(map(jnp.asarray, rates))
    )


def leg_line(walker, motion, leg):
    poses = (pose_of(walker, motion),) * len(walker.bodies)
    return legs_in(walker, poses)[leg]


def torque_of(walker, motion=None, *, leg):
    motion = MOTION if motion is None else motion
    line = None if leg is None else leg_line(walker, motion, leg)
    return motor_torque(walker, 0, motion, 0.02, leg, line)


ANGLES, RATES = (0.3, -0.2, 0.1, 0.05), (1.0, -2.0, 0.5, 0.7)


def test_the_angle_of_a_vector_is_the_arctangents():
    angle = np.concatenate([np.linspace(-np.pi, np.pi, 2001)[1:-1], np.arange(-3, 4) * np.pi / 4])
    y, x = 2.5 * np.sin(angle), 2.5 * np.cos(angle)
    np.testing.assert_allclose(angle_of_vector(y, x), np.arctan2(y, x), rtol=0, atol=1e-15)
    found = jax.grad(angle_of_vector, (0, 1))(0.3, -0.4)
    np.testing.assert_allclose(found, (-0.4 / 0.25, -0.3 / 0.25), rtol=1e-15)


def test_a_legs_line_of_a_kneed_walker_and_its_rate():
    walker, leg = kneed(), 1
    found = leg_line(walker, motion_with(ANGLES, RATES), leg)
    x = 0.184 * math.sin(0.1) + 0.136 * math.sin(0.05)
    down = 0.184 * math.cos(0.1) + 0.136 * math.cos(0.05)
    assert float(found.angle) == pytest.approx(math.atan2(x, down), rel=1e-14)

    def angle(t):
        moved = [a + t * w for a, w in zip(ANGLES, RATES, strict=True)]
        return leg_line(walker, motion_with(moved, RATES), leg).angle

    assert float(found.rate) == pytest.approx(float(jax.grad(angle)(0.0)), rel=1e-13)


def test_a_leg_of_one_body_turns_as_that_body_does():
    feet = tuple(
        jb.Foot(f"leg_{i}", centre=(0.3, ahead), name=name)
        for i in (1, 2)
        for name, ahead in (("heel", -0.04), ("toe", 0.10))
    )
    motion = motion_with((0.3, -0.2), (1.0, -2.0))
    straight, flat = leg_line(two_legs(), motion, 1), leg_line(two_legs(feet=feet), motion, 1)
    assert float(straight.angle) == pytest.approx(-0.2, rel=1e-14)
    assert float(straight.rate) == -2.0
    assert float(flat.angle) == pytest.approx(-0.2 + math.atan2(0.03, 0.3), rel=1e-14)
    assert float(flat.rate) == -2.0


@pytest.mark.parametrize("turned", [-1.9, 1.9])
def test_a_foot_above_the_root_is_where_the_line_points(turned):
    """The head of a torso that leans forward is ahead of the root, not behind it."""
    feet = [jb.Foot(name, centre=place) for name, place in (("leg_1", 0.3), ("torso", -0.3))]
    walker = jb.Mechanism(bodies=(*LEGS, TORSO), feet=feet)
    found = leg_line(walker, motion_with((0.0, 0.0, turned), RATES[:3]), 1)
    assert float(found.angle) == pytest.approx(turned - math.copysign(math.pi, turned), rel=1e-14)
    assert float(found.rate) == RATES[2]


def with_motor(law, angle=LEANING, **given):
    return two_legs(jb.Motor(angle, law, **given), bodies=(*LEGS, TORSO))


MOTION = motion_with((0.3, -0.2, 0.1), (1.0, -2.0, 0.5))


def test_laws_read_any_angle_and_the_phase():
    structure, line = (
        with_motor(jb.actuation.Constant(1.0)).structure,
        leg_line(two_legs(), MOTION, 1),
    )
    seen = MotorMotion(structure, MOTION.angles, MOTION.rates, 0.02, structure.joints[0], line)
    np.testing.assert_allclose((seen.angle, seen.rate), (0.1 - 0.02, 0.5), rtol=1e-15)
    np.testing.assert_allclose(seen.of("leg_1"), (0.3, 1.0))
    np.testing.assert_allclose(seen.of({"leg_1": 1, "leg_2": -1}), (0.5, 3.0), rtol=1e-15)
    np.testing.assert_allclose((seen.phase, seen.phase_rate), (0.2, 2.0))
    with pytest.raises(jb.ArgumentError, match=r"motion\.of names 'knee', which is not a body"):
        seen.of("knee")
    with pytest.raises(jb.ArgumentError, match=r"motion\.phase is not known"):
        _ = seen._replace(stance=None).phase


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (jb.actuation.Constant(0.7), 0.7),
        (jb.actuation.PD(2.0, 0.5, target=0.1), -2.0 * (0.08 - 0.1) - 0.5 * 0.5),
        (jb.actuation.PD(2.0, of="leg_2"), 0.4),
        (jb.actuation.PD(2.0, 1.0, of={"torso": 1, "leg_2": -1}), -0.6 - 2.5),
        (jb.actuation.Pulse(0.5, at=0.1, width=0.2), 0.5 * math.exp(-0.25)),
        (jb.actuation.Pulse(0.5, at=0.1, width=0.2, of="leg_1"), 0.5 * math.exp(-1.0)),
        (jb.actuation.Spline((0.3,) * 6, first=-0.5, last=0.5), 0.3),
        (jb.actuation.Spline((0.3,) * 6, first=-0.5, last=0.5, of="leg_1"), 0.3),
        (lambda motion: 3.0 * motion.phase_rate, 6.0),
    ],
)
def test_parts_are_the_formulas_of_their_docstrings(law, expected):
    found = torque_of(with_motor(law), leg=1)
    assert float(found.torque) == pytest.approx(expected, rel=1e-13)


def test_a_pulse_and_a_spline_are_those_at_the_hip():
    pulse, hip = jb.actuation.Pulse(0.5, 0.1, 0.2), jb.actuation.HipPulse(0.5, 0.1, 0.2)
    spline = jb.actuation.Spline((0.1, 0.5, -0.2), -0.3, 0.3)
    hip_spline = jb.actuation.HipSpline((0.1, 0.5, -0.2), -0.3, 0.3)
    for law, other in ((pulse, hip), (spline, hip_spline)):
        torque = torque_of(with_motor(law), leg=1).torque
        assert float(torque) == pytest.approx(float(other.torque_at(jnp.asarray(0.2))), rel=1e-13)


def test_roles_are_exchanged_where_the_first_leg_stands():
    law = jb.actuation.PD(2.0, 0.3, of={"torso": 1, "leg_2": -1})
    walker = with_motor(law, angle={"leg_2": 1, "torso": -1})
    second = torque_of(walker, leg=1)
    first = torque_of(walker, exchanged(walker.structure, MOTION), leg=0)
    assert second.angle.weights == ((1, 1.0), (2, -1.0))
    assert first.angle.weights == ((0, 1.0), (2, -1.0))
    assert float(first.torque) == float(second.torque)
    untied = walker.untied()
    assert float(torque_of(untied, leg=0).torque) == float(torque_of(walker, leg=0).torque)
    by_side = with_motor(jb.actuation.PD(1.0), angle="torso", by="side")
    told = [torque_of(by_side, leg=leg) for leg in (0, 1, None)]
    assert [float(each.torque) for each in told] == [-0.1] * 3


def test_in_double_support_each_leg_drives_by_its_share_of_the_load():
    """A constant torque from leg to torso: 0.7 times each share, on the leg that has it."""
    walker = with_motor(jb.actuation.Constant(0.7), angle={"leg_2": 1, "torso": -1})
    lines = [leg_line(walker, MOTION, leg) for leg in (0, 1)]
    shares = (jnp.asarray(0.25), jnp.asarray(0.75))
    found = motor_torques(walker, MOTION, 0.02, lines, shares)
    by_leg = {angle.weights[0][0]: float(torque) for _, angle, torque in found}
    assert by_leg == pytest.approx({0: 0.25 * 0.7, 1: 0.75 * 0.7}, rel=1e-15)
    alone = motor_torques(walker, MOTION, 0.02, lines, (None, jnp.asarray(1.0)))
    assert [float(torque) for _, _, torque in alone] == [0.7]
    (power,) = motor_powers(walker, MOTION, 0.02, lines, shares)
    expected = 0.25 * 0.7 * (1.0 - 0.5) + 0.75 * 0.7 * (-2.0 - 0.5)
    assert float(power) == pytest.approx(expected, rel=1e-14)


def test_gains_are_parameters_and_functions_are_none():
    walker = with_motor(jb.actuation.PD(2.0, 0.3, of="leg_2"))
    assert walker.parameter_names()[-2:] == ("torso.motor.kp", "torso.motor.kd")
    slopes = jax.grad(lambda walker: torque_of(walker, leg=1).torque)(walker)
    np.testing.assert_allclose(jax.tree.leaves(slopes.joints[0].law), (0.2, 2.0))
    spline = with_motor(jb.actuation.Spline((0.1, 0.2), -0.3, 0.3))
    assert spline.parameter_names()[-4:-2] == ("torso.motor.torque_1", "torso.motor.torque_2")
    plain = with_motor(lambda motion: -motion.rate)
    assert not any("motor" in name for name in plain.parameter_names())
    assert len(jax.tree.leaves(plain)) == len(plain.parameter_names())


def test_coupled_bodies_are_exchanged_with_the_others():
    walker = two_legs(jb.Coupling(BISECTING), bodies=(*LEGS, TORSO))
    swapped = exchanged(walker.structure, MOTION)
    assert [float(a) for a in swapped.angles] == [-0.2, 0.3, 0.1]


@pytest.mark.parametrize("law", [lambda: 1.0, lambda motion, time: 1.0, 2.0])
def test_a_law_takes_the_motion_alone(law):
    with pytest.raises(
        jb.ArgumentError, match=r"Motor\('a'\): give a function of the motion alone"
    ):
        jb.Motor("a", law)


def test_a_law_reads_no_time_where_none_is_known():
    with pytest.raises(jb.ArgumentError, match=r"motion\.time is not known here, .* a Scene"):
        torque_of(with_motor(lambda motion: motion.time), leg=1)


@pytest.mark.parametrize("told", [None, (1.0, 2.0), np.ones(3), 1j])
def test_a_law_that_returns_no_torque_is_refused(told):
    with pytest.raises(jb.ArgumentError, match="must return one torque"):
        torque_of(with_motor(lambda motion: told), leg=1)


@pytest.mark.parametrize(
    "law",
    [
        lambda motion: 0.1 if motion.angle > 0.0 else 0.0,
        lambda motion: np.sin(motion.angle),
        lambda motion: math.sin(motion.angle),
    ],
)
def test_a_law_that_cannot_be_traced_is_refused(law):
    walker = with_motor(law)

    def traced(angle):
        return torque_of(walker, MOTION._replace(angles=(angle,) * 3), leg=1).torque

    with pytest.raises(jb.ArgumentError, match=r"takes the motion for plain numbers, .*jax\.numpy"):
        jax.eval_shape(traced, 0.1)
