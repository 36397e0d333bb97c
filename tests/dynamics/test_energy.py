"""Energies and powers, against the rate of change that each power claims to be."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

DOUBLE = jb.State(*map(jnp.asarray, (0.1, 0.3895, 0.255, -0.25, 0.4, -0.1, -1.2, -1.4)))


@pytest.mark.parametrize("state", [jb.seed_state(), DOUBLE], ids=["single", "double"])
@pytest.mark.parametrize("hip_mass", [0.0, 2.0])
def test_power_balance(state, hip_mass):
    """d(kinetic + gravitational + elastic)/dt = −damper − friction, and gravity's power."""
    scene = jb.seed_scene(hip_mass=hip_mass)
    rate = jb.dynamics.vector_field(0.0, state, scene)
    change = jax.jvp(lambda s: jb.dynamics.energies(scene, s), (state,), (rate,))[1]
    power = jb.dynamics.powers(scene, state)
    assert float(power.friction) > 0.0
    scale = float(power.damper + power.friction)
    assert float(change.total) == pytest.approx(-scale, rel=1e-10)
    assert float(power.gravity) == pytest.approx(-float(change.gravitational), rel=1e-10)
    both = jb.dynamics.feet(scene, state)
    forces = jb.dynamics.foot_forces(scene, state)
    work = sum(f.normal * b.penetration_rate for f, b in zip(forces, both, strict=True))
    assert float(power.indentation) == pytest.approx(float(work), rel=1e-12)


def test_kinetic_energy_is_the_masses_own():
    scene, s = jb.seed_scene(hip_mass=0.7), jb.seed_state()
    energy = 0.5 * 0.7 * (0.49797**2 + 0.05853**2)
    for a, w in ((s.theta_1, s.omega_1), (s.theta_2, s.omega_2)):
        vx = 0.49797 + 0.1 * np.cos(a) * w
        vz = 0.05853 + 0.1 * np.sin(a) * w
        energy += 0.5 * (vx**2 + vz**2) + 0.5 * 0.0096 * w**2
    assert float(jb.dynamics.energies(scene, s).kinetic) == pytest.approx(float(energy), rel=1e-12)
