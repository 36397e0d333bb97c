"""Events of a rigid walker with knees, against equations by hand: every root of a dense solve."""

import functools

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import jaxbiped as jb
from jaxbiped.models import hsu_chen
from tests.models.by_hand import HOW, Knees

COUNT, END = 60, 6.0
AHEAD = 1e-3
"""How far ahead a foot strikes at least [m], for the feet of legs side by side are level, too."""
FALL = np.cos(1.0)
LEG = (0.5, 0.5, 0.325), (0.05, 0.5, 0.125)
KNEE, STRIKE, FALLS, NEVER = range(4)


def legs(y):
    """Heights of the hip over both feet, and how far the swinging one is ahead."""
    (sines, cosines) = (0.5 * f(y[:4]) for f in (np.sin, np.cos))
    swing, stance = ((0, 1), (2, 3))
    heights = [sum(cosines[k] for k in leg) for leg in (swing, stance)]
    return *heights, sum(sines[k] for k in swing) - sum(sines[k] for k in stance)


def clearance(y):
    swing, stance, _ = legs(y)
    return stance - swing


def first_event(walker, y, t, bent):
    """Which comes first, when, and the state there."""
    free = walker.bent if bent else walker.free
    surfaces = {STRIKE: clearance, FALLS: lambda y: legs(y)[1] - FALL}
    if bent:
        surfaces[KNEE] = lambda y: y[0] - y[1]

    def low(_, y):
        return legs(y)[1] - 0.9 * FALL

    low.terminal = True
    solved = solve_ivp(walker.field(free), (t, END), y, dense_output=True, events=low, **HOW)
    times = np.linspace(t, solved.t[-1], 20_001)
    states, found = solved.sol(times), []
    for which, surface in surfaces.items():
        values = surface(states)
        for k in np.flatnonzero((values[:-1] > 0.0) & (values[1:] <= 0.0)):
            value = lambda time, surface=surface: surface(solved.sol(time))
            at = brentq(value, times[k], times[k + 1], xtol=1e-14)
            if which != STRIKE or legs(solved.sol(at))[2] > AHEAD:
                found.append((at, which))
                break
    at, which = min(found, default=(END, NEVER))
    return which, at, solved.sol(at)


def first_footstep(walker, y):
    """What ends a footstep, and when: the knee that locks on the way does not."""
    which, t, y = first_event(walker, y, 0.0, True)
    if which == KNEE:
        y = np.concatenate([y[:4], walker.kept(y, walker.leg, walker.free)])
        which, t, _ = first_event(walker, y, t, False)
    return which, t


@pytest.mark.slow
def test_strikes_and_falls_are_those_of_a_dense_solve():
    scene = hsu_chen()
    draws = np.random.default_rng(17).uniform(-1.0, 1.0, (5, COUNT))
    swing, stance, bend = 0.3 * draws[0] - 0.2, 0.2 * draws[2] + 0.2, 0.01 + 0.4 * np.abs(draws[1])
    rate, standing, shank = 2.0 * draws[3], 0.6 * draws[4] - 1.1, 2.0 * draws[1]
    starts = scene.state(
        theta_thigh_1=swing, theta_shank_1=swing - bend, theta_thigh_2=stance, theta_shank_2=stance,
        omega_thigh_1=rate, omega_shank_1=rate - shank, omega_thigh_2=standing,
        omega_shank_2=standing, held="shank_2",
    )  # fmt: skip
    walker = Knees(*LEG, hip_mass=0.5, slope=0.0504, g=9.81)
    angles = swing, swing - bend, stance, stance
    rows = np.stack([*angles, rate, rate - shank, standing, standing], axis=1)
    true = [first_footstep(walker, row) for row in rows]

    def one(start, accuracy):
        walk = jb.simulate(scene, start, footsteps=1, duration=END, accuracy=accuracy)
        return walk.t[-1], walk.arrivals.total, walk.grazes

    struck = np.array([which == STRIKE for which, _ in true])
    assert 30 < np.sum(struck) < 54
    for accuracy, most in (("balanced", 1e-5), ("tight", 1e-9)):
        found = jax.vmap(functools.partial(one, accuracy=accuracy))(starts)
        t, strikes, grazes = map(np.asarray, found)
        off = np.abs(t - [time for _, time in true])
        same = ((strikes > 0) == struck) & (off < most)
        assert np.all(same | (grazes > 0))
        assert np.sum(grazes > 0) <= 2


STRAIGHT = dict(theta_thigh_1=-0.24, theta_shank_1=-0.24, theta_thigh_2=0.24, theta_shank_2=0.24)
RATES = dict(omega_thigh_1=-0.05, omega_shank_1=-0.05, omega_thigh_2=-1.1, omega_shank_2=-1.1)


@pytest.mark.parametrize(("swing", "stance"), [(0.0, 0.0), (1.0, 0.0), (0.0, 0.5), (0.7, 0.5)])
def test_a_straight_knee_that_moves_into_its_stop_hits_it_at_once(swing, stance):
    walker, scene = Knees(*LEG, hip_mass=0.5, slope=0.0504, g=9.81), hsu_chen()
    rates = RATES | dict(omega_shank_1=-0.05 + swing, omega_shank_2=-1.1 + stance)
    y = np.array([*STRAIGHT.values(), *rates.values()])
    y = np.concatenate([y[:4], walker.kept(y, walker.leg, walker.free)])
    which, t, _ = first_event(walker, y, 0.0, False)
    walk = jb.simulate(scene, scene.state(**STRAIGHT, **rates), footsteps=1, accuracy="tight")
    assert which == STRIKE
    assert float(walk.t[-1]) == pytest.approx(t, abs=1e-10)


@pytest.mark.parametrize(
    "changed", [dict(omega_shank_1=0.95), dict(theta_shank_1=-0.4), dict(theta_shank_1=0.1)]
)
def test_a_knee_that_is_moved_while_it_is_held_is_refused(changed):
    """Also in a batch, where its lane fails alone."""
    scene = hsu_chen()
    good = scene.state(**STRAIGHT, **RATES)
    with pytest.raises(jb.ArgumentError, match=r"state.mode = 3.0 .* 'shank_1'"):
        jb.simulate(scene, good._replace(**changed), footsteps=1)
    ((name, value),) = changed.items()

    def walked(each):
        walk = jb.simulate(scene, good._replace(**{name: each}), footsteps=1)
        return walk.ending, walk.t[-1]

    endings, _ = jax.vmap(walked)(np.array([getattr(good, name), value]))
    assert endings.tolist() == [int(jb.Ending.WALKING), int(jb.Ending.SOLVER_FAILED)]


@pytest.mark.slow
def test_a_stop_that_is_just_touched_has_no_derivative_and_is_counted():
    """Between shanks that swing up to the stop and those that turn back before it."""
    scene = hsu_chen()
    start = scene.state(**STRAIGHT | dict(theta_shank_1=-0.34), **RATES, held="shank_2")

    def walk(rate):
        state = start._replace(omega_shank_1=rate)
        return jb.simulate(scene, state, footsteps=9, duration=0.12, accuracy="tight")

    low, high = 0.0, 8.0
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if len(walk(middle).modes) > 1 else (middle, high)
    slope = jax.jacfwd(lambda rate: walk(rate).final.omega_shank_1)
    assert int(walk(low).grazes) > 0
    assert np.isnan(slope(low))
    for away in (-1e-4, 1e-4):
        rate, h = low + away, 1e-5
        ends = [float(walk(rate + sign * h).final.omega_shank_1) for sign in (-1.0, 1.0)]
        assert int(walk(rate).grazes) == 0
        assert float(slope(rate)) == pytest.approx((ends[1] - ends[0]) / (2.0 * h), rel=1e-4)


@pytest.mark.slow
def test_knees_that_throw_each_other_off_come_to_rest():
    """A swinging knee that is hit throws the standing one off its stop, ever less, five times here.

    The time of six footsteps is that of coordinates of all bodies with multipliers, by SciPy's
    DOP853 at 1e-12; there, too, bounces whose flight is below 1e-12 rad end at rest.
    """
    thigh = dict(mass=0.4, inertia=0.004, centre=0.2)
    shank = dict(mass=0.25, inertia=0.006, centre=(0.2, -0.005), at=0.5)
    legs = [
        (jb.Body(f"thigh_{i}", **thigh), jb.Body(f"shank_{i}", parent=f"thigh_{i}", **shank))
        for i in (1, 2)
    ]
    walker = jb.Mechanism(
        root_mass=3.0,
        bodies=(*legs[0], *legs[1]),
        feet=tuple(jb.Foot(f"shank_{i}", centre=(0.3, 0.06), radius=0.2) for i in (1, 2)),
        joints=tuple(jb.Stop(f"shank_{i}", upper=0.1) for i in (1, 2)),
        mirror=(("thigh_1", "thigh_2"), ("shank_1", "shank_2")),
    )
    scene = jb.RigidScene(walker, jb.Ground(slope=0.04, g=9.81))
    start = scene.state(
        theta_thigh_1=-0.112, theta_shank_1=-0.015, theta_thigh_2=0.001, theta_shank_2=0.036,
        omega_thigh_1=-0.16, omega_shank_1=-0.16, omega_thigh_2=-0.62, omega_shank_2=0.31,
    )  # fmt: skip
    walk = jb.simulate(scene, start, footsteps=6, accuracy="tight")
    assert walk.outcome is jb.Ending.WALKING
    assert np.all(walk.mode_durations >= 0.0)
    assert float(walk.t[-1]) == pytest.approx(5.68027408622, abs=1e-9)
    assert sum(mode[1:] == ("shank_1 held", "shank_2 held") for mode in walk.modes) >= 4
