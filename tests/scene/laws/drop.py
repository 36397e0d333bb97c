"""A mass that drops onto a normal law, without gravity, by SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp


def restitutions(law, speeds, *, mass=1.0, duration=0.2):
    """Coefficients of restitution of many drops at once.

    Args:
        law: its parameters numbers, or arrays of an entry for each drop.
        speeds: approach speeds [m/s], shape (n,).
        mass: what drops [kg].
        duration: after which all must be out again [s].
    """
    speeds = np.asarray(speeds, float)
    force = jax.jit(lambda depth, rate: law.force(depth, rate))

    def field(_, y):
        depth, rate = np.split(y, 2)
        return np.concatenate([rate, -np.asarray(force(jnp.asarray(depth), rate)) / mass])

    start = np.concatenate([np.full_like(speeds, 1e-15), speeds])
    solution = solve_ivp(
        field, (0.0, duration), start, method="DOP853", rtol=1e-8, atol=1e-12, first_step=1e-7
    )
    depth, rate = np.split(solution.y[:, -1], 2)
    assert (depth < 0.0).all()
    return -rate / speeds
