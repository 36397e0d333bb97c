"""Rigid walkers of the literature, and what was published of them."""

import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

STABLE = (0.200310900544287, -0.199832473004977)
"""Stance angle and rate after the strike of the simplest walker at γ = 0.009, as published."""
UNSTABLE = (0.193937369810184, -0.203866927442010)
MULTIPLIER = -0.190099841069 + 0.557598776679j
FIRST_DOUBLING = 0.0150884379


simplest_walker, compass_gait = jb.models.garcia, jb.models.goswami


def simplest_state(theta, rate):
    """Just after a strike: θ of the stance leg and its rate, the swing leg's from the impact."""
    swing = rate - rate * (1.0 - np.cos(2.0 * theta))
    return jb.dynamics.RigidState(*map(jnp.asarray, (0.0, -theta, theta, swing, rate)))


def rigid_seed(slope=0.02):
    """The seed's walker on rigid feet."""
    return jb.RigidScene(walker=jb.seed_scene().walker, ground=jb.Ground(slope=slope))
