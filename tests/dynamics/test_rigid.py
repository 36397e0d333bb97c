"""Rolling of the rigid walker, against its energy and what real feet would do."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed


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
    scene = rigid_seed(0.03)
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
