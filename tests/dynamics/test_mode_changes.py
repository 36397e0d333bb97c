"""Changes of mode, against contact conditions and angles that are written out here."""

import itertools
import math

import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped import Body, Foot, Mechanism, Stop
from jaxbiped.dynamics._holds import Holds, on_held
from jaxbiped.dynamics._mode_changes import change_mode
from jaxbiped.dynamics._stance import stance_on
from jaxbiped.hybrid import Rolling
from jaxbiped.scene._joint_parts import HOLDS
from jaxbiped.scene._modes import leg_after_strike, rigid_modes
from tests.dynamics.test_modes import (
    ANGLES,
    HEEL_TOE,
    HIP,
    RATES,
    hsu_chen,
    in_mode,
    loads_of_feet,
)
from tests.dynamics.test_rolling_mechanisms import rigid
from tests.mechanisms import FEET, LEGS, PAIR, SLOPE, WALKERS
from tests.scene.test_mechanism import spokes


def mode_of(scene, state):
    """Which feet stand and which limits are held, as lists of bool."""
    mode = rigid_modes(scene.mechanism).decoded(np, np.float64(state.mode))
    return list(map(bool, mode.stands)), list(map(bool, mode.held))


@pytest.mark.parametrize(
    ("free", "loose", "expected"),
    [
        ((-1.0, -4.0), (True, True), (True, True)),
        # Both would pull; without the one that pulls more the other is pressed.
        ((-1.0, 4.0), (True, True), (True, False)),
        ((4.0, -1.0), (True, True), (False, True)),
        ((1.0, 4.0), (True, True), (False, False)),
        ((-1.0, 4.0), (True, False), (False, True)),
        ((-1.0, 4.0), (False, True), (True, False)),
    ],
)
def test_of_two_stops_the_one_that_pulls_most_is_let_go_first(free, loose, expected):
    """Reactions λ ≥ 0 of W λ = −free, where W is ((2, −1), (−1, 2))."""
    numbers = [[np.float64(x) for x in row] for row in ((2.0, -1.0), (-1.0, 2.0))]
    answers = [dict(enumerate(row)) for row in numbers]
    holds = Holds([{0: 1.0}, {1: 1.0}], answers, [numbers[0][:1], numbers[1]])
    values = {k: np.float64(x) for k, x in enumerate(free)}
    held = holds.pressed(values, (np.True_, np.True_), loose)
    assert tuple(map(bool, held)) == expected


def test_what_was_let_go_is_held_again_where_it_would_pass():
    """The one set of reactions λ ≥ 0 and rates W λ + free ≥ 0 of which one of each pair is 0: only
    the second is let go. On the way the first is, too, and comes back."""
    numbers = np.array([[6.0, -2.0, 0.0], [-2.0, 4.0, -4.0], [0.0, -4.0, 5.0]])
    free = np.array([2.0, -3.0, 5.0])
    sets = []
    for held in itertools.product((False, True), repeat=3):
        on, reactions = np.flatnonzero(held), np.zeros(3)
        reactions[on] = np.linalg.solve(numbers[np.ix_(on, on)], -free[on])
        if np.all(reactions >= 0.0) and np.all(numbers @ reactions + free >= -1e-12):
            sets.append(held)
    rows = [{i: np.float64(x) for i, x in enumerate(row)} for row in numbers]
    mobility = [list(row[: i + 1]) for i, row in enumerate(numbers)]
    holds = Holds([{i: 1.0} for i in range(3)], rows, mobility)
    found = holds.pressed(dict(enumerate(free)), (np.True_,) * 3, (True,) * 3)
    assert sets == [tuple(map(bool, found))]


def test_held_limits_that_share_bodies_are_all_met_by_the_nearest_angles():
    """Straight knees and thighs 0.3 apart, by least squares: thigh and shank of a leg at the mean
    of 0.31, 0.33, 0.28 and 0.29."""
    thigh, shank = (dict(mass=0.5, inertia=0.005, centre=0.1), dict(mass=0.3, inertia=0.003))
    bodies = [Body(f"thigh_{i}", **thigh) for i in (1, 2)]
    bodies += [Body(f"shank_{i}", **shank, centre=0.1, parent=f"thigh_{i}", at=0.2) for i in (1, 2)]
    stops = [*(Stop(f"shank_{i}", upper=0.0) for i in (1, 2)), Stop(HIP, upper=0.3)]
    feet = [Foot(f"shank_{i}", centre=0.2) for i in (1, 2)]
    scene = rigid(Mechanism(root_mass=1.0, bodies=bodies, feet=feet, joints=stops))
    angles = dict(theta_thigh_1=0.31, theta_thigh_2=-0.02, theta_shank_1=0.33, theta_shank_2=-0.01)
    upright = scene.state(**dict.fromkeys(angles, 0.0), held=())
    after = on_held(scene, in_mode(scene, upright._replace(**angles), (0, 1, 2), (True, False)))
    found = [float(getattr(after, name)) for name in angles]
    np.testing.assert_allclose(found, [0.3025, 0.0025, 0.3025, 0.0025], atol=1e-14)


@pytest.mark.parametrize(
    ("angle", "rate", "stands"),
    [
        (0.0, 0.0, [True, True]),
        (0.0, -5.0, [False, True]),
        (0.0, 5.0, [True, False]),
        (0.1, 0.0, [True, False]),
        (-0.1, -5.0, [False, True]),
    ],
)
def test_of_a_flat_foot_the_end_that_would_have_to_pull_is_let_go(angle, rate, stands):
    """The ankle's spring and damper press on the heel or on the toe alone."""
    scene = rigid(HEEL_TOE)
    state = scene.state(theta_leg_1=-0.3, theta_leg_2=angle, omega_leg_2=rate)
    state = in_mode(scene, state, (), stands=(True, True))
    assert [float(load) > 0.0 for load in loads_of_feet(scene, state)] == stands
    assert mode_of(scene, change_mode(scene, state))[0] == stands


def test_a_load_that_has_fallen_to_zero_is_let_go_on_either_side_of_it():
    """Between two neighbouring numbers it changes its sign: what lies on a surface is there."""
    scene = rigid(HEEL_TOE)

    def flat(angle):
        return in_mode(scene, scene.state(theta_leg_1=-0.3, theta_leg_2=angle), (), (True, True))

    def least(angle):
        return min(map(float, loads_of_feet(scene, flat(angle))))

    above, below = 0.0, 0.1
    while above < (middle := 0.5 * (above + below)) < below:
        above, below = (middle, below) if least(middle) > 0.0 else (above, middle)
    assert 0.0 < least(above) < 1e-12
    for angle in (above, below):
        assert mode_of(scene, Rolling().reset_at_switch(scene, flat(angle), 1))[0] == [True, False]


def test_a_foot_that_comes_down_flat_turns_no_more():
    scene = rigid(HEEL_TOE)
    angles = dict(theta_leg_1=0.1, theta_leg_2=-0.1)
    state = scene.state(**angles, omega_leg_2=-1.0, omega_foot_1=2.0)
    struck = jb.dynamics.impact(scene, state)
    assert mode_of(scene, struck.state)[0] == [True, True]
    assert abs(float(struck.state.omega_foot_2)) < 1e-14
    assert abs(float(struck.state.omega_leg_2)) > 0.1


@pytest.mark.parametrize(
    ("angle", "stands"), [(0.2, [True, False]), (0.0, [True, True]), (-0.2, [False, True])]
)
def test_a_start_stands_on_the_end_of_its_foot_that_is_lower(angle, stands):
    """A foot that is turned up at its toe stands on its heel; so it does where it lands."""
    scene = rigid(HEEL_TOE)
    state = scene.state(theta_leg_1=0.1, theta_leg_2=-0.1, theta_foot_2=angle)
    assert mode_of(scene, state)[0] == stands
    state = scene.state(theta_leg_1=0.1, theta_leg_2=-0.1, theta_foot_1=angle, omega_leg_2=-1.0)
    assert mode_of(scene, jb.dynamics.impact(scene, state).state)[0] == stands


def test_heights_of_feet_are_those_of_their_lowest_points():
    """Of circles of unlike radii: the hip is as high as the leg that stands carries it."""
    scene = rigid(Mechanism(bodies=LEGS, feet=(FEET[0], Foot("leg_2", centre=0.3, radius=0.05))))
    state = scene.state(theta_leg_1=0.3, theta_leg_2=-0.2, standing="leg_2")
    stance = stance_on(scene, state, 1)
    hip = 0.3 * math.cos(0.2) + 0.05
    assert float(stance.height(0)) == pytest.approx(hip - 0.32 * math.cos(0.3) - 0.08, rel=1e-13)
    assert abs(float(stance.height(1))) < 1e-15


@pytest.mark.parametrize(("rate", "holds"), [(-0.3, False), (0.0, True), (0.3, False)])
def test_a_start_holds_the_stops_at_whose_limit_it_rests(rate, holds):
    """One that moves into its limit hits it."""
    scene = hsu_chen()
    state = scene.state(**ANGLES, **RATES, omega_shank_1=rate)
    assert mode_of(scene, state)[1] == [holds, True]


def with_stop(**limits):
    """Straight legs with a stop between a leg and the vertical."""
    stops = [Stop({f"leg_{i}": 1, "vertical": -1}, **limits) for i in (1, 2)]
    return rigid(Mechanism(root_mass=1.0, bodies=LEGS, feet=FEET, joints=stops, mirror=PAIR))


def test_a_limits_distance_is_told_from_within():
    scene = with_stop(upper=0.4, lower=-0.5)
    limits = rigid_modes(scene.mechanism).limits
    found = [limit.distance(scene.mechanism, (0.1, -0.2), SLOPE) for limit in limits]
    angles = np.array([0.1, -0.2]) - SLOPE
    expected = [0.4 - angles[0], angles[0] + 0.5, 0.4 - angles[1], angles[1] + 0.5]
    np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize("limits", [dict(upper=0.4), dict(lower=-0.4)])
@pytest.mark.parametrize("speed", [-1.0, 1.0])
def test_a_stop_is_hit_by_what_moves_into_it_alone(limits, speed):
    """Return maps go through the change, which stops the angle; one that leaves is not held."""
    scene = with_stop(**limits, holds="until heel strike")
    (limit,) = limits.values()
    state = scene.state(
        theta_leg_1=limit + SLOPE, theta_leg_2=-0.1, omega_leg_1=speed, omega_leg_2=-0.7, held=()
    )
    after = Rolling().reset_at_switch(scene, state, 1)
    if speed * limit < 0.0:
        assert [float(x) for x in after] == [float(x) for x in state]
    else:
        assert mode_of(scene, after)[1] == [True, False]
        assert abs(float(after.omega_leg_1)) < 1e-14
        assert float(after.omega_leg_2) != -0.7


def test_unlike_legs_stand_by_turns():
    unlike, alike = WALKERS["unequal"].structure, WALKERS["torso"].structure
    assert [leg_after_strike(unlike, leg) for leg in (0, 1)] == [1, 0]
    assert leg_after_strike(alike, alike.stance_leg) == alike.stance_leg
    scene = rigid(WALKERS["unequal"])
    for foot, stands in (("leg_1", [False, True]), ("leg_2", [True, False])):
        state = scene.state(theta_leg_1=0.2, theta_leg_2=-0.2, omega_leg_1=-1.0, standing=foot)
        assert mode_of(scene, jb.dynamics.impact(scene, state).state)[0] == stands


def test_what_is_held_exchanges_its_name_with_the_legs():
    """The knee that was locked while its leg swung is the second one's when that leg stands."""
    scene = hsu_chen("until heel strike")
    state = scene.state(**ANGLES, **RATES, held="shank_1")
    assert mode_of(scene, state)[1] == [True, False]
    assert mode_of(scene, jb.dynamics.impact(scene, state).state)[1][1]


def test_the_leg_that_stood_stays_locked_where_its_stop_holds_through_the_strike():
    """The impulse bends its knee unless it is held; the knee that lands is locked either way."""
    bends = {}
    angles = dict(theta_thigh_1=0.2, theta_shank_1=0.2, theta_thigh_2=-0.2, theta_shank_2=-0.2)
    for holds in HOLDS:
        scene = hsu_chen(holds)
        after = jb.dynamics.impact(scene, scene.state(**angles, **RATES)).state
        bends[holds] = float(after.omega_shank_1 - after.omega_thigh_1)
        assert mode_of(scene, after)[1] == [False, holds != HOLDS[0]]
    assert abs(bends[HOLDS[2]]) < 1e-13
    assert bends[HOLDS[0]] < bends[HOLDS[1]] < -0.5


@pytest.mark.parametrize("times", [-1, 1, 2])
def test_a_wheel_of_four_spokes_turns_by_a_quarter(times):
    scene = rigid(spokes())
    state = scene.state(theta_wheel=0.1, omega_wheel=-1.0)
    turned = jb.dynamics.exchange_legs(scene, state, times)
    assert float(turned.theta_wheel) == pytest.approx(0.1 + times * math.pi / 2.0, rel=1e-15)
    assert float(turned.omega_wheel) == -1.0
