"""Checks of the rigid limit, against what real feet would do."""

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed


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
