"""Rolling and impact of the rigid walker against equations written a second time."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.rigid import rigid_walker

import jaxbiped as jb
from tests.rigid_walkers import compass_gait, rigid_seed, simplest_walker

WALKERS = [rigid_seed(0.03), compass_gait(), jb.RigidScene(
    jb.Walker(m=1.3, J=0.02, l=0.7, d=0.2, r=0.15, hip_mass=0.8), jb.Ground(slope=-0.05, g=3.0)
)]  # fmt: skip
floats = lambda low, high: st.floats(low, high, allow_subnormal=False)
states = st.builds(
    lambda a, b, p, q: jb.dynamics.RigidState(*map(jnp.asarray, (0.3, a, b, p, q))),
    floats(-0.9, 0.9), floats(-0.9, 0.9), floats(-4.0, 4.0), floats(-4.0, 4.0),
)  # fmt: skip


@pytest.mark.parametrize("scene", WALKERS)
@settings(deadline=None, max_examples=25)
@given(states)
def test_rolling_solves_the_equations(scene, state):
    walker, y = rigid_walker(scene), np.array(state[1:], dtype=float)
    solved = np.array([*walker.rates(y)[2:], *walker.force(y)])
    motion = jb.dynamics.rolling(scene, state)
    got = [motion.alpha_1, motion.alpha_2, motion.force.tangential, motion.force.normal]
    scale = np.abs(solved).max()
    np.testing.assert_allclose(np.array(got), solved, rtol=1e-10, atol=1e-12 * scale)
    field = np.array(jb.dynamics.rolling_field(0.0, state, scene))
    expected = [walker.whole_rates(y[:, None])[0][0], *walker.rates(y)]
    np.testing.assert_allclose(field, expected, rtol=1e-10, atol=1e-12 * scale)


@pytest.mark.parametrize("scene", WALKERS)
@settings(deadline=None, max_examples=25)
@given(states)
def test_an_impact_keeps_two_angular_momenta_and_stops_the_new_contact(scene, state):
    """And it is the plastic impulse of the equations with multipliers."""
    walker, reach = scene.walker, float(scene.walker.hip_to_foot)
    state = state._replace(theta_2=-state.theta_1)
    whole, reference = jb.dynamics.whole_state(scene, state), rigid_walker(scene)
    whole_rates = lambda y: reference.whole_rates(y[:, None])[0]
    y = np.array(state[1:], dtype=float)
    theta, before = y[:2], whole_rates(y)
    found = jb.dynamics.impact(scene, state)
    after = whole_rates(np.array(found.state[1:], dtype=float))
    np.testing.assert_allclose(np.array(found.state[1:3]), theta[::-1], rtol=0.0, atol=0.0)
    after = np.array([after[0], after[1], after[3], after[2]])  # by the old names
    hip = np.array([0.0, float(whole.hip_z)])
    contact = hip + reach * np.array([np.sin(theta[0]), -np.cos(theta[0])])
    contact[1] -= float(walker.r)

    def momentum_about(point, rates, legs, with_hip):
        total = 0.0
        bodies = [(float(walker.hip_mass), hip, rates[:2], 0.0)] if with_hip else []
        for i in legs:
            axis = np.array([np.sin(theta[i]), -np.cos(theta[i])])
            turn = np.array([np.cos(theta[i]), np.sin(theta[i])])
            d = float(walker.d)
            bodies.append((float(walker.m), hip + d * axis, rates[:2] + d * turn * rates[2 + i],
                           float(walker.J) * rates[2 + i]))  # fmt: skip
        for mass, place, velocity, spin in bodies:
            arm = place - point
            total += mass * (arm[0] * velocity[1] - arm[1] * velocity[0]) + spin
        return total

    scale = 1.0 + np.abs(before).max() * float(walker.total_mass)
    for point, legs, with_hip in ((contact, (0, 1), True), (hip, (1,), False)):
        kept = momentum_about(point, before, legs, with_hip)
        assert abs(momentum_about(point, after, legs, with_hip) - kept) < 1e-12 * scale
    (rates,), (solved,) = reference.impact(y)
    np.testing.assert_allclose(after, rates, rtol=1e-9, atol=1e-11 * scale)
    impulse = [found.impulse_x, found.impulse_z]
    np.testing.assert_allclose(np.array(impulse), solved, rtol=1e-9, atol=1e-11 * scale)
    trailing = reference.contact_rows(y[:, None], 1)[0, 1] @ after
    np.testing.assert_allclose(found.lifting, trailing, rtol=1e-9, atol=1e-11 * scale)


def test_the_simplest_walkers_equations():
    """θ̈ = sin(θ − γ), φ̈ = θ̈ + sin φ (θ̇² − cos(θ − γ)) with φ the angle between the legs."""
    gamma = 0.009
    scene = simplest_walker(gamma)
    for theta, rate, phi, turn in ((0.2, -0.2, 0.4, -0.01), (-0.1, -0.3, -0.3, 0.5)):
        state = jb.dynamics.RigidState(
            *map(jnp.asarray, (0.0, theta - phi, theta, rate - turn, rate))
        )
        motion = jb.dynamics.rolling(scene, state)
        stance = np.sin(theta - gamma)
        swing = stance + np.sin(phi) * (rate**2 - np.cos(theta - gamma))
        np.testing.assert_allclose(motion.alpha_2, stance, rtol=1e-11)
        np.testing.assert_allclose(motion.alpha_2 - motion.alpha_1, swing, rtol=1e-11)


def energy(scene, state):
    walker, ground = scene.walker, scene.ground
    whole = jb.dynamics.whole_state(scene, state)
    down = jnp.array([jnp.sin(ground.slope), -jnp.cos(ground.slope)])
    hip = jnp.array([whole.hip_x, whole.hip_z])
    speed = jnp.array([whole.hip_vx, whole.hip_vz])
    total = walker.hip_mass * (0.5 * speed @ speed - ground.g * down @ hip)
    for angle, rate in ((state.theta_1, state.omega_1), (state.theta_2, state.omega_2)):
        place = hip + walker.d * jnp.array([jnp.sin(angle), -jnp.cos(angle)])
        velocity = speed + walker.d * rate * jnp.array([jnp.cos(angle), jnp.sin(angle)])
        total += walker.m * (0.5 * velocity @ velocity - ground.g * down @ place)
        total += 0.5 * walker.J * rate**2
    return total


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-11])
def test_a_swing_keeps_energy_to_the_tolerance(rtol):
    scene = WALKERS[0]
    start = jb.dynamics.RigidState(*map(jnp.asarray, (0.0, -0.24, 0.24, -1.09, -1.64)))
    swing = jb.rigid_walk(scene, start, duration=0.3, rtol=rtol)
    assert int(swing.arrivals.total) == 0
    before, after = float(energy(scene, start)), float(energy(scene, swing.final))
    # In units of the kinetic energy, which the rates' tolerance is felt in.
    assert abs(after - before) < 3.0 * rtol * 0.33


def test_checks_name_what_a_real_foot_would_do():
    scene = rigid_seed()
    fast = jb.dynamics.RigidState(*map(jnp.asarray, (0.0, -0.2, 0.2, 0.0, -12.0)))
    still = fast._replace(omega_2=jnp.asarray(0.0), theta_1=jnp.asarray(0.1))
    two = jax.tree.map(lambda a, b: jnp.stack([a, b]), fast, still)
    checks = jb.dynamics.rigid_checks(scene, two)
    assert checks.flies.tolist() == [True, False]  # centripetal: 12² × 0.3 m/s² lifts it
    assert checks.scuffs.tolist() == [False, True]  # the swing leg is the more upright one
    assert checks.slips(0.01).tolist() == [True, True]
    assert checks.slips(10.0).tolist() == [True, False]
    assert float(checks.needed_friction[0]) == np.inf
