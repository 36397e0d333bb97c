"""Rigid walkers of the literature, and what was published of them."""

import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

STABLE = (0.200310900544287, -0.199832473004977)
"""Stance angle and rate after the strike of the simplest walker at γ = 0.009, as published."""
UNSTABLE = (0.193937369810184, -0.203866927442010)
MULTIPLIER = -0.190099841069 + 0.557598776679j
FIRST_DOUBLING = 0.0150884379


def simplest_walker(slope):
    """A hip of mass one on massless legs: their own, at the feet, is far below rounding."""
    walker = jb.Walker(m=1e-13, J=0.0, l=1.0, d=1.0, r=0.0, hip_mass=1.0)
    return jb.RigidScene(walker=walker, ground=jb.Ground(slope=slope, g=1.0))


def simplest_state(theta, rate):
    """Just after a strike: θ of the stance leg and its rate, the swing leg's from the impact."""
    swing = rate - rate * (1.0 - np.cos(2.0 * theta))
    return jb.dynamics.RigidState(*map(jnp.asarray, (0.0, -theta, theta, swing, rate)))


def compass_gait():
    """Mass points on the legs' middles and at the hip, on a slope of three degrees."""
    walker = jb.Walker(m=5.0, J=0.0, l=1.0, d=0.5, r=0.0, hip_mass=10.0)
    return jb.RigidScene(walker=walker, ground=jb.Ground(slope=float(np.deg2rad(3.0))))


def rigid_seed(slope=0.02):
    """The seed's walker on rigid feet."""
    return jb.RigidScene(walker=jb.seed_scene().walker, ground=jb.Ground(slope=slope))
