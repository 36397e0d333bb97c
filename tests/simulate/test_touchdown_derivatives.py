"""Derivatives where a walk ends at a touchdown, against those of a much finer solve."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from tests.mechanisms import seed_walker

pytestmark = pytest.mark.slow


def _heavier_on_one_side(friction):
    """The seed's walker with a heavier leg, on Kelvin and Voigt's ground, and a start."""
    seed = jb.seed_scene(slope=0.02)
    slips = {name: getattr(seed.friction, name) for name in ("mu_static", "mu_kinetic", "v0", "xi")}
    own = dict(K=seed.normal.K, c=seed.normal.c, n=seed.normal.n)
    of_mass = dict(mass=seed.walker.total_mass, g=seed.ground.g)
    scene = dataclasses.replace(
        seed,
        walker=seed_walker(first=1.02),
        normal=jb.laws.normal_law_like("kelvin-voigt", **own, **of_mass),
        friction=jb.laws.friction_law_like(friction, **slips),
    )
    start = scene.state(theta_1=0.1, omega_1=2.3, omega_2=-0.69, standing="2")
    return scene, start._replace(hip_z=start.hip_z - 1e-6)


def test_derivatives_at_a_touchdown_are_those_before_the_force_jumps():
    scene, start = _heavier_on_one_side("stribeck")

    def final(mu, rtol):
        moved = jb.with_parameters(scene, {"mu_kinetic": mu})
        return jnp.stack(jb.simulate(moved, start, footsteps=2, save="end", rtol=rtol).final)

    # Nanoseconds behind the touchdown, some are fifty times as large.
    mu = scene.friction.mu_kinetic
    right = np.asarray(jax.jacfwd(final)(mu, 1e-10))
    for rtol in (1e-6, 7e-7, 5e-7):
        told = np.asarray(jax.jacfwd(final)(mu, rtol))
        np.testing.assert_allclose(told, right, atol=2e-2 * np.max(np.abs(right)))
