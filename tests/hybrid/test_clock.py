"""The time since the last strike: a clock that strikes restart, against SciPy and differences."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline

import jaxbiped as jb
from jaxbiped.models import hsu_chen

A = jb.actuation
HIP, LEG, ALONG, G = 10.0, 5.0, 0.5, 9.81
"""A compass of unit length: masses at the hip and half way down each leg [kg]."""
COMPASS = jb.Walker(m=LEG, J=0.0, l=1.0, d=ALONG, r=0.0, hip_mass=HIP)
LEVEL = jb.Ground(slope=0.0, g=G)
CUBIC = A.TimePolynomial(torque=(2.0, 6.0, -5.0, 1.0), span=0.7)
SCENE = jb.RigidScene(COMPASS, LEVEL, CUBIC)
ANGLES = dict(theta_1=-0.1635, theta_2=0.1635, omega_1=-0.36, omega_2=-0.695)
START = SCENE.state(**ANGLES)
BARE = jb.dynamics.RigidState(*START[:5])
SPLINE = BSpline(np.arange(-3.0, 5.0), (2.0, 6.0, -5.0, 1.0), 3)
"""Of one interval, from 0 to 1."""


def rates(y, torque):
    """Lagrange's equations of the swing leg and the stance leg, with a torque between them."""
    swing, stance, fast, slow = y
    coupling = LEG * ALONG * np.cos(stance - swing)
    turn = LEG * ALONG * np.sin(stance - swing)
    mass = np.array([[LEG * ALONG**2, -coupling], [-coupling, HIP + LEG * (1 + ALONG**2)]])
    force = [
        torque - turn * slow**2 - LEG * ALONG * G * np.sin(swing),
        -torque + turn * fast**2 + (HIP + LEG * (1 + ALONG)) * G * np.sin(stance),
    ]
    return [fast, slow, *np.linalg.solve(mass, force)]


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def struck(y):
    """Behind a plastic strike: momenta about the new foot, and of the old leg about the hip."""
    swing, stance, fast, slow = y

    def along(angle):
        return np.array([np.sin(angle), -np.cos(angle)])

    def across(angle):
        return np.array([np.cos(angle), np.sin(angle)])

    def momenta(hip, ahead, behind):
        foot = along(swing)
        masses = [
            (HIP, 0.0 * foot, hip),
            (LEG, ALONG * along(swing), hip + ALONG * across(swing) * ahead),
            (LEG, ALONG * along(stance), hip + ALONG * across(stance) * behind),
        ]
        whole = sum(m * cross(place - foot, speed) for m, place, speed in masses)
        m, place, speed = masses[-1]
        return np.array([whole, m * cross(place, speed)])

    before = momenta(-across(stance) * slow, fast, slow)
    by_rates = [momenta(-across(swing) * a, a, b) for a, b in ((1.0, 0.0), (0.0, 1.0))]
    new_stance, new_swing = np.linalg.solve(np.transpose(by_rates), before)
    return np.array([stance, swing, new_swing, new_stance])


def footsteps_by_scipy(y, torque, count):
    """Times and states behind strikes of a walk whose torque is a function of time since each."""
    t, found = 0.0, []

    def lands(_, y):
        return y[0] + y[1]

    lands.direction = -1
    for _ in range(count):
        walk = solve_ivp(
            lambda s, y: rates(y, torque(s)), (0.0, 1.4), y, "DOP853", None, events=lands,
            rtol=1e-12, atol=1e-14,
        )  # fmt: skip
        ends = zip(walk.t_events[0], walk.y_events[0], strict=True)
        after, on = next((s, on) for s, on in ends if on[0] > 0.05)
        t, y = t + after, struck(on)
        found.append([t, *y])
    return np.array(found)


@pytest.mark.parametrize("engine", ["lanes", pytest.param("xla", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", [jb.actuation.TimePolynomial, jb.actuation.TimeSpline])
def test_a_walk_of_a_law_of_time_is_scipys(kind, engine):
    scene = dataclasses.replace(SCENE, actuation=kind(torque=(2.0, 6.0, -5.0, 1.0), span=0.7))

    def torque(time):
        place = min(time, 0.7) / 0.7
        if kind is A.TimePolynomial:
            return np.polyval([1.0, -5.0, 6.0, 2.0], place)
        return SPLINE(place)

    expected = footsteps_by_scipy(np.array(list(ANGLES.values())), torque, 4)
    walk = jb.rigid_walk(scene, START, footsteps=4, max_arrivals=4, rtol=1e-12, engine=engine)
    found = np.column_stack([walk.arrivals.t, *walk.arrivals.state[1:5]])
    np.testing.assert_allclose(found, expected, atol=2e-9)
    assert not np.any(walk.arrivals.state.clock)


def test_every_way_to_save_tells_the_time_since_the_last_strike():
    strikes = jb.rigid_walk(SCENE, START, footsteps=2, max_arrivals=2).arrivals.t

    def since(times):
        times = np.asarray(times)
        return times - np.max(np.where(strikes <= times[:, None], strikes, 0.0), axis=1)

    times = jnp.linspace(0.1, 2.0, 7)
    saved = jb.simulate(SCENE, START, duration=2.1, save=times)
    np.testing.assert_allclose(saved.state.clock, since(times), atol=1e-7)
    end = jb.simulate(SCENE, START, duration=2.0, save="end")
    np.testing.assert_allclose(end.state.clock, since(end.t), atol=1e-7)
    steps = jb.simulate(SCENE, START, duration=2.0, save="steps")
    clock, expected = np.asarray(steps.state.clock), since(steps.t)
    before = np.isclose(steps.t[:, None], strikes).any(axis=1) & (clock > 0.0)
    np.testing.assert_allclose(clock[~before], expected[~before], atol=1e-7)
    assert before.sum() == 2
    np.testing.assert_allclose(steps.dense.evaluate(0.3).clock, 0.3, atol=1e-12)
    passing = jb.simulate(SCENE, START, footsteps=3, save=jb.MidStance(), max_arrivals=3).arrivals
    count = int(passing.total)
    np.testing.assert_allclose(passing.state.clock[:count], since(passing.t[:count]), atol=1e-6)


def test_a_start_without_a_clock_begins_at_zero():

    one, other = (jb.simulate(SCENE, each, duration=1.2).state for each in (BARE, START))
    np.testing.assert_array_equal(np.stack(one), np.stack(other))
    late = jb.simulate(SCENE, START._replace(clock=jnp.asarray(0.2)), duration=0.5)
    assert float(late.state.clock[-1]) == pytest.approx(0.7, abs=1e-12)


@pytest.mark.slow
def test_derivatives_of_a_return_are_difference_quotients():
    centre = jnp.asarray([*START[:5], 0.05, *CUBIC.torque, CUBIC.span])

    def returned(numbers):
        law = A.TimePolynomial(tuple(numbers[6:10]), numbers[10])
        scene = dataclasses.replace(SCENE, actuation=law)
        found = jb.return_map(scene, type(START)(*numbers[:6]), accuracy="tight")
        return jnp.stack([*found.state, found.time])

    slopes, quotients = jax.jacfwd(returned)(centre), []
    for step in 2e-4 * jnp.eye(11)[1:]:
        far, near = (returned(centre + a * step) - returned(centre - a * step) for a in (2.0, 1.0))
        quotients.append((8.0 * near - far) / 24e-4)
    np.testing.assert_allclose(slopes[:, 1:], np.transpose(quotients), rtol=1e-6, atol=1e-6)
    assert not np.any(slopes[5])


@pytest.mark.slow
def test_a_law_that_stays_the_same_adds_a_multiplier_of_zero():
    ground = jb.Ground(slope=0.03, g=G)
    laws = [A.HipTorque(0.4), A.TimePolynomial(0.4, 0.7), A.TimeSpline([0.4] * 5, 0.6)]
    plain, *clocked = (
        jb.find_gait(jb.RigidScene(COMPASS, ground, law), BARE, radius_sensitivities=False)
        for law in laws
    )
    for gait in clocked:
        np.testing.assert_allclose(gait.measures.state[:5], plain.measures.state, atol=1e-9)
        np.testing.assert_allclose(gait.multipliers[:3], plain.multipliers, atol=1e-8)
        assert abs(gait.multipliers[3]) < 1e-12
        assert float(gait.measures.state.clock) == 0.0


@pytest.mark.slow
def test_labels_of_starts_are_those_of_walks():
    scene = jb.RigidScene(COMPASS, jb.Ground(slope=0.03, g=G), A.TimePolynomial((0.6, -0.3), 0.7))
    gait = jb.find_gait(scene, START, parameters=("torque_2", "span"))
    assert bool(gait.stable)
    labelling = jb.labelling(scene, guess=gait)
    axes = {"omega_swing": np.linspace(-1.5, 0.5, 7), "theta_swing": np.linspace(-0.3, -0.15, 5)}
    starts = jb.starts.grid(scene, axes | {"clock": np.array([0.0, 0.3])}).at(
        labelling, np.arange(70)
    )
    walks = jax.vmap(lambda state: jb.rigid_walk(scene, state, footsteps=30))(starts.states)
    found = labelling(starts.states).label
    np.testing.assert_array_equal(found, walks.ending)
    assert 0 < np.sum(found > 0) < 70


@pytest.mark.slow
def test_only_strikes_restart_the_clock_of_a_walker_whose_knees_lock():
    """A plain function reads the time, too; a motor between the thighs is one at the hip."""
    passive = hsu_chen()

    def scene(law):
        parts = passive.mechanism.arguments()
        drive = jb.Motor({"thigh_1": 1, "thigh_2": -1}, law, name="drive")
        walker = jb.Mechanism(**parts | {"joints": (*parts["joints"], drive)})
        return dataclasses.replace(passive, walker=walker)

    law = A.TimeSpline((0.02, 0.02, 0.01, 0.0), 0.4)
    kneed = scene(law)
    assert kneed.state_names[-2:] == ("clock", "mode")
    names = [f"{body}_{leg}" for leg in (1, 2) for body in ("thigh", "shank")]
    angles, rates = (-0.239, -0.239, 0.239, 0.239), (0.01, 0.01, -1.09, -1.09)
    values = {f"theta_{name}": angle for name, angle in zip(names, angles, strict=True)}
    values |= {f"omega_{name}": rate for name, rate in zip(names, rates, strict=True)}
    start = kneed.state(**values)
    walk = jb.rigid_walk(kneed, start, footsteps=3, max_arrivals=3)
    assert str(walk.outcome) == "walking"
    assert int(walk.mode_history.total) > 3
    times = jnp.linspace(0.0, float(walk.t[-1]) - 0.01, 40)
    saved = jb.simulate(kneed, start, footsteps=3, save=times)
    strikes = np.asarray(walk.arrivals.t)
    since = times - np.max(np.where(strikes <= times[:, None], strikes, 0.0), axis=1)
    np.testing.assert_allclose(saved.state.clock, since, atol=1e-7)
    by_function = jb.rigid_walk(scene(lambda motion: law(motion)), start, footsteps=3)
    np.testing.assert_allclose(np.stack(by_function.state), np.stack(walk.state), atol=1e-12)
    at_hip = dataclasses.replace(passive, actuation=law)
    hip = jb.rigid_walk(at_hip, start, footsteps=3)
    np.testing.assert_allclose(np.stack(hip.state), np.stack(walk.state), atol=1e-10)


def test_redundant_coordinates_have_no_clock():
    scene = dataclasses.replace(jb.seed_scene(), actuation=A.TimePolynomial(0.01, 0.7))
    with pytest.raises(jb.ArgumentError, match=r"reads motion\.time, which is not allowed"):
        jb.RedundantScene(scene)
