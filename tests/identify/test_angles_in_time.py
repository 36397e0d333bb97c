"""Angles of a gait in time, against functions that the legs' angles are, and clocks set wrong."""

from collections import namedtuple

import numpy as np
import pytest

from jaxbiped.identify import MeasuredAngles
from jaxbiped.identify._predicted_gait import AnglesInTime, _curves, clock_zero
from tests.identify.test_fit_of_mechanisms import TORSO

States = namedtuple("States", "hip_x theta_1 theta_2 omega_1 omega_2")
FIRST, SECOND = 0.4, 0.6
WHOLE = 2.0 * np.pi / (FIRST + SECOND)


def swings(t):
    """The angle of the leg that swings first, and its rate; its period is that of two footsteps."""
    angle = 0.3 * np.sin(WHOLE * t + 0.2) + 0.1 * np.cos(2.0 * WHOLE * t)
    rate = 0.3 * WHOLE * np.cos(WHOLE * t + 0.2) - 0.2 * WHOLE * np.sin(2.0 * WHOLE * t)
    return angle, rate


def stands(t):
    return 0.25 * np.cos(WHOLE * t - 0.4), -0.25 * WHOLE * np.sin(WHOLE * t - 0.4)


def later(t):
    """The same leg half a period later, as the other one of a gait of one footstep."""
    return swings(t + 0.5)


def part(begin, length, first, second):
    """A part of the cycle and the same with the legs' names exchanged."""
    clock = np.linspace(0.0, length, 400)
    (a, da), (b, db) = (leg(begin + clock) for leg in (first, second))
    return (
        _curves(clock, States(0.0 * clock, a, b, da, db)),
        _curves(clock, States(0.0 * clock, b, a, db, da)),
    )


TWO = (
    AnglesInTime(
        [part(0.0, FIRST, swings, stands), part(FIRST, SECOND, stands, swings)],
        np.array([FIRST, FIRST + SECOND]), 0.1,
    ), stands,
)  # fmt: skip
ONE = AnglesInTime([part(0.0, 0.5, swings, later)], np.array([0.5]), 0.1), later


@pytest.mark.parametrize(("angles", "other"), [TWO, ONE], ids=["two footsteps", "one footstep"])
def test_a_leg_keeps_its_name_from_footstep_to_footstep(angles, other):
    times = np.array([0.0, 0.1, 0.39, 0.41, 0.5, 0.77, 0.99, 1.01, 1.3, 1.7, 2.9, 4.45, 6.6])
    seen = MeasuredAngles(times, 1e-3, np.zeros(13), np.zeros(13))
    for shift in (0.0, 0.15, -0.8):
        found, rates = angles.at(seen, shift)
        expected = [leg(times + shift) for leg in (swings, other)]
        np.testing.assert_allclose(found, np.concatenate([e[0] for e in expected]), atol=1e-8)
        np.testing.assert_allclose(rates, np.concatenate([e[1] for e in expected]), atol=1e-4)
    many, _ = angles.at(seen, np.array([0.0, 0.15]))
    np.testing.assert_array_equal(many[1], angles.at(seen, 0.15)[0])
    lost, _ = AnglesInTime([], np.array([np.nan]), np.nan).at(seen, 0.0)
    assert np.isnan(lost).all()


@pytest.mark.parametrize(("angles", "other"), [TWO, ONE], ids=["two footsteps", "one footstep"])
@pytest.mark.parametrize("shift", [0.03, 0.45, 0.88])
def test_a_clock_is_set_by_where_its_angles_fit_best(angles, other, shift):
    times = np.linspace(0.0, 0.7, 15)
    legs = [leg(times + shift)[0] for leg in (swings, other)]
    seen = MeasuredAngles(times, 1e-3, *legs)
    assert clock_zero(angles, seen) == pytest.approx(shift, abs=1e-7)
    alone = MeasuredAngles(times, 1e-3, theta_2=legs[1])
    assert clock_zero(angles, alone) == pytest.approx(shift, abs=1e-7)
    assert clock_zero(angles, MeasuredAngles(times, 1e-3, *legs, since="mid-stance")) == 0.1


@pytest.mark.slow
def test_legs_exchange_their_parts_and_a_torso_goes_on(torso_gait):
    """A step later each leg does what the other one did, and the torso the same again."""
    gait = torso_gait
    curves, period = AnglesInTime.of(TORSO, gait), float(gait.measures.period)
    clock = np.linspace(0.05, 0.45, 9)
    names = ("theta_leg_1", "theta_leg_2", "theta_torso")

    def at(shift, *order):
        blank = {name: np.zeros(9) for name in order}
        seen = MeasuredAngles(clock, 1e-3, **blank)
        return curves.at(seen, shift)[0]

    now = at(0.0, *names)
    np.testing.assert_allclose(at(period, names[1], names[0], names[2]), now, atol=1e-6)
    np.testing.assert_allclose(at(2.0 * period, *names), now, atol=1e-6)
    states = gait.orbit[1]
    here = np.interp(clock, np.asarray(gait.orbit[0][0]), np.asarray(states.theta_torso[0]))
    np.testing.assert_allclose(now[18:], here, atol=1e-3)
