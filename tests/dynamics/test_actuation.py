"""Actuators in the equations of motion, against equations written a second time."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from extreme_cases.case import check_numbers
from reference.actuation import actuated_derivative
from reference.rigid import rigid_walker
from scipy.integrate import solve_ivp

import jaxbiped as jb
from jaxbiped.compiler import host_jit

A = jb.actuation
SEED = jb.seed_scene(hip_mass=0.3)
SPRING = A.HipSpring(k=0.06, b=0.002, theta_0=0.15)
PULSE = A.HipPulse(0.05, phase=0.1, width=0.08, reaction="trunk")
PRELOAD = A.FootPreload(extension=2e-3, onset=0.05, span=0.08)
PUSH = A.PushOff(0.15)
AT_HIP = (SPRING, A.HipTorque(0.02), PULSE)


def torques(angles, rates, shares):
    """What `AT_HIP` does to both legs, by hand."""
    swing_is_leg_1 = shares[1] - shares[0]
    on_1 = -0.06 * (angles[0] - angles[1] - 0.15 * swing_is_leg_1) - 0.002 * (rates[0] - rates[1])
    on_1 += 0.02 * swing_is_leg_1
    pulses = -shares * 0.05 * np.exp(-(((-angles - 0.1) / 0.08) ** 2))
    return np.array([on_1, -on_1]) + pulses


def extension(angle, rate):
    """What `PRELOAD` does to a foot, by hand."""
    bent = np.tanh((-angle - 0.05) / 0.08)
    return 1e-3 * (1.0 + bent), -1e-3 * (1.0 - bent**2) * rate / 0.08


DRIVEN = dataclasses.replace(SEED, actuation=(*AT_HIP, PRELOAD))
RIGID = jb.RigidScene(SEED.walker, SEED.ground, (*AT_HIP, PUSH))
NUMBERS = check_numbers(SEED)
ROLLING = rigid_walker(SEED, torques=lambda y: torques(y[:2], y[2:], np.array([[0.0], [1.0]])))


def test_passive_scenes_take_the_operations_that_they_took():
    """As counted: actuators bring none that they do not need."""
    counts = {name: sum(jb.measure.operation_counts(s).values()) for name, s in jb.ladder().items()}
    assert counts == {"rigid": 144, "creep": 441, "stribeck": 431, "bristles": 439}
    for part in (*AT_HIP, PRELOAD):
        driven = dataclasses.replace(jb.seed_scene(), actuation=part)
        assert sum(jb.measure.operation_counts(driven).values()) > counts["stribeck"]


def _states(count):
    """States with one foot on the ground or both, or in flight."""
    rng = np.random.default_rng(5)
    for k in range(count):
        angles = rng.uniform(-0.3, 0.3, 2)
        if k % 3 == 0:
            angles[0] = -angles[1]
        rates = rng.uniform(-2.0, 2.0, 2)
        rates[1] = -abs(rates[1])
        if k % 3 == 0:
            rates[0] = -abs(rates[0])
        deep = 6e-4 if k % 5 else -2e-2
        height = float(jb.dynamics.standing_height(SEED, angles[1], deep))
        reach = float(SEED.walker.hip_to_foot)
        sink = -reach * np.sin(angles[1]) * rates[1] + rng.uniform(-1e-4, 1e-4)
        along = -(reach * np.cos(angles[1]) + float(SEED.walker.r)) * rates[1]
        place = [0.1, height, *angles, along + rng.uniform(-1e-3, 1e-3), sink, *rates]
        yield jb.State(*map(jnp.asarray, place))


def test_accelerations_are_those_of_equations_written_again():
    in_contact = 0
    for state in _states(30):
        y = np.array(state, dtype=float)
        expected = actuated_derivative(0.0, y, NUMBERS, torques, extension)[4:]
        found = np.array(jb.dynamics.accelerations(DRIVEN, state))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
        forces = jb.dynamics.foot_forces(DRIVEN, state)
        in_contact += float(forces[1].normal) > 0.0
    assert 10 < in_contact < 30


@pytest.mark.parametrize("orientation", ["angle", "euler"])
def test_redundant_coordinates_move_alike(orientation):
    scene = jb.RedundantScene(DRIVEN, "standard", orientation)
    for state in list(_states(6)):
        found = jb.dynamics.redundant_motion(scene, jb.dynamics.redundant_state(scene, state))
        expected = np.array(jb.dynamics.accelerations(DRIVEN, state))
        np.testing.assert_allclose(np.array(found.minimal), expected, rtol=1e-8, atol=1e-8)


def test_rolling_is_that_of_equations_written_again():
    for state in list(_states(12)):
        rigid = jb.dynamics.rigid_state(state)
        y = np.array(rigid[1:], dtype=float)
        expected = ROLLING.rates(y)[2:]
        found = jb.dynamics.rolling(RIGID, rigid)
        np.testing.assert_allclose([found.alpha_1, found.alpha_2], expected, rtol=1e-11)


@pytest.mark.slow
def test_a_driven_walk_is_scipys():
    """Over a heel strike, by an implicit method on the second writing."""
    scene = dataclasses.replace(jb.seed_scene(), actuation=(*AT_HIP, PRELOAD))
    start, end = jb.seed_state(), 0.5
    solved = solve_ivp(
        actuated_derivative, (0.0, end), np.array(start, dtype=float), "Radau",
        args=(check_numbers(scene), torques, extension), rtol=1e-9, atol=1e-11,
    )  # fmt: skip
    assert solved.success
    walk = jb.simulate(scene, start, duration=end, accuracy="tight", engine="lanes")
    np.testing.assert_allclose(np.array(walk.final), solved.y[:, -1], rtol=2e-6, atol=2e-6)
    passive = jb.simulate(jb.seed_scene(), start, duration=end, accuracy="tight", engine="lanes")
    assert abs(float(passive.final.theta_1 - walk.final.theta_1)) > 0.005
    assert np.any(np.diff(np.sign(solved.y[6])))


def test_a_driven_rigid_footstep_is_scipys():
    start = jb.dynamics.rigid_state(jb.seed_state())
    y = np.array(start[1:], dtype=float)
    rates = lambda t, y: ROLLING.rates(y)
    solved = solve_ivp(rates, (0.0, 0.3), y, "DOP853", rtol=1e-12, atol=1e-13)
    walk = jb.rigid_walk(RIGID, start, duration=0.3, accuracy="tight", engine="lanes")
    assert int(walk.arrivals.total) == 0
    np.testing.assert_allclose(np.array(walk.final[1:]), solved.y[:, -1], rtol=1e-9)


def _before_impact():
    return jb.dynamics.RigidState(*map(jnp.asarray, (0.0, 0.21, -0.21, -0.4, -1.3)))


def test_a_push_off_is_an_impulse_on_the_free_walker_before_the_impact():
    state = _before_impact()
    walker, y = rigid_walker(RIGID), np.array(state[1:], dtype=float)
    theta, rates = y[:2], walker.whole_rates(y[:, None])[0]
    (matrix,), reach = walker.mass_matrix(y[:, None]), walker.reach
    outward = np.array([-np.sin(theta[1]), np.cos(theta[1])])
    # On the foot's centre, whose velocity has these rows in (hip x, hip z, θ1, θ2).
    rows = np.zeros((2, 4))
    rows[:, :2] = np.eye(2)
    rows[:, 3] = reach * np.array([np.cos(theta[1]), np.sin(theta[1])])
    pushed = rates + np.linalg.solve(matrix, rows.T @ outward * 0.15)
    (after,), (impulse,) = rigid_walker(RIGID, push_off=0.15).impact(y)
    found = jb.dynamics.impact(RIGID, state)
    np.testing.assert_allclose(found.state.omega_2, after[2], rtol=1e-12)
    np.testing.assert_allclose(found.state.omega_1, after[3], rtol=1e-12)
    np.testing.assert_allclose([found.impulse_x, found.impulse_z], impulse, rtol=1e-11)
    gain = 0.5 * (pushed @ matrix @ pushed - rates @ matrix @ rates)
    assert float(jb.dynamics.push_off_work(RIGID, state)) == pytest.approx(gain, rel=1e-12)
    passive = jb.RigidScene(RIGID.walker, RIGID.ground)
    assert float(jb.dynamics.push_off_work(passive, state)) == 0.0


def test_two_push_offs_add_up():
    twice = jb.RigidScene(SEED.walker, SEED.ground, (A.PushOff(0.05), A.PushOff(0.1)))
    once = jb.RigidScene(SEED.walker, SEED.ground, A.PushOff(0.15))
    found, expected = (jb.dynamics.impact(scene, _before_impact()) for scene in (twice, once))
    np.testing.assert_allclose(np.array(found.state), np.array(expected.state), rtol=1e-14)


def _idle(scene):
    return dataclasses.replace(scene, actuation=tuple(part.idle() for part in scene.actuation))


def test_at_strength_zero_the_fields_are_the_passive_ones():
    idle = _idle(DRIVEN)
    for state in list(_states(6)):
        expected = np.array(jb.dynamics.accelerations(SEED, state))
        found = np.array(jb.dynamics.accelerations(idle, state))
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)
    idle, passive = _idle(RIGID), jb.RigidScene(SEED.walker, SEED.ground)
    found, expected = (jb.dynamics.impact(s, _before_impact()) for s in (idle, passive))
    np.testing.assert_allclose(np.array(found.state), np.array(expected.state), rtol=1e-15)


@pytest.mark.slow
def test_both_engines_roll_alike():
    start = jb.dynamics.rigid_state(jb.seed_state())
    one, other = (
        jb.rigid_walk(RIGID, start, footsteps=3, accuracy="tight", engine=engine)
        for engine in ("xla", "lanes")
    )
    np.testing.assert_allclose(np.array(one.final), np.array(other.final), rtol=1e-11)


@pytest.mark.nightly
def test_both_engines_walk_alike():
    options = dict(duration=0.42, accuracy="tight", save="end")
    one, other = (
        jb.simulate(DRIVEN, jb.seed_state(), engine=engine, **options)
        for engine in ("xla", "lanes")
    )
    np.testing.assert_allclose(np.array(one.final), np.array(other.final), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("scene", [DRIVEN, RIGID], ids=["compliant", "rigid"])
def test_fields_are_smooth_in_every_number_of_the_actuators(scene):
    """Derivatives with respect to leaves against central differences."""
    state = jb.seed_state()
    if not scene.compliant:
        state = _before_impact()

    def field(actuation):
        driven = dataclasses.replace(scene, actuation=actuation)
        if scene.compliant:
            return jnp.stack(jb.dynamics.accelerations(driven, state))
        rates = jb.dynamics.rolling(driven, state)
        return jnp.stack([rates.alpha_1, rates.alpha_2, *jb.dynamics.impact(driven, state).state])

    leaves, structure = jax.tree_util.tree_flatten(scene.actuation)
    slopes = jax.tree_util.tree_leaves(host_jit()(jax.jacfwd(field))(scene.actuation))
    value = host_jit(within=True)(field)
    for i, (leaf, slope) in enumerate(zip(leaves, slopes, strict=True)):
        step = 1e-5 * max(abs(float(leaf)), 1e-2)
        moved = [
            value(structure.unflatten([*leaves[:i], np.float64(leaf) + s, *leaves[i + 1 :]]))
            for s in (step, -step)
        ]
        difference = (moved[0] - moved[1]) / (2.0 * step)
        size = 1.0 + np.abs(difference).max()
        np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-5 * size)
