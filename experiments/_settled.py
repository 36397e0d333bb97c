"""What walking forwards settles on: the truth that a search for gaits is held to.

Walks begin from rolling starts and from the states on which neighbouring scenes settled; the one
that comes nearest to repeating itself is walked on for 300 footsteps, more accurately.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

STARTS, FOOTSTEPS, LONG = 48, 60, 300
CYCLES = (1, 2, 3, 4, 6, 8)
"""Lengths [footsteps] of cycles that are told apart."""
_SETTLED = 1e-7
"""Relative change of the duration of a cycle from one to the next that counts as none."""


class Settled(NamedTuple):
    """What the walks of a scene do in the long run.

    Attributes:
        cycle: footsteps in the cycle that the longest walk repeats; 0 where it repeats none, −1
            where no walk goes on.
        period: duration of that cycle [s], NaN where there is none.
        state: of the walk's last arrival, None where no walk goes on.
    """

    cycle: int
    period: float
    state: Any


def settled(scene, near, *, seed):
    """Where walks from rolling starts, and from states `near` by, settle."""
    starts = jb.gait.rolling_starts(scene, STARTS, spread=0.5, seed=seed)
    for i, state in enumerate(near[-4:]):
        starts = jax.tree.map(lambda leaf, own, i=i: leaf.at[1 + i].set(own), starts, state)
    times, states, counts = _walked(scene, starts, FOOTSTEPS, 1e-5)
    walking = np.flatnonzero(np.asarray(counts) >= FOOTSTEPS)
    if not len(walking):
        return Settled(-1, float("nan"), None)
    durations = np.diff(np.asarray(times)[walking, -9:], axis=1)
    # How far each is from repeating itself after one footstep, or after two, or four.
    open_ = [min(abs(row[-1] / row[-1 - k] - 1.0) for k in (1, 2, 4)) for row in durations]
    best = walking[int(np.argmin(open_))]
    start = jax.tree.map(lambda leaf: leaf[best][None], states)
    times, states, counts = _walked(scene, start, LONG, 3e-9)
    if int(counts[0]) < LONG:
        return Settled(-1, float("nan"), None)
    times, state = np.asarray(times)[0], jax.tree.map(lambda leaf: leaf[0], states)
    for cycle in CYCLES:
        last, before = times[-1] - times[-1 - cycle], times[-1 - cycle] - times[-1 - 2 * cycle]
        if abs(last / before - 1.0) < _SETTLED:
            return Settled(cycle, float(last), state)
    return Settled(0, float("nan"), state)


@eqx.filter_jit
def _walked(scene, starts, footsteps, rtol):
    """Times of the arrivals, the last state with leg 2 standing, and how many there were."""

    def walk(start):
        if isinstance(scene, jb.RigidScene):
            how = dict(footsteps=footsteps, rtol=1e-11, max_arrivals=footsteps)
            return jb.rigid_walk(scene, start, **how).arrivals
        how = dict(footsteps=footsteps + 1, save=jb.MidStance(), max_arrivals=footsteps)
        how |= dict(rtol=rtol, max_solver_steps=1_000_000, engine="lanes")
        return jb.simulate(scene, start, **how).arrivals

    def one(start):
        at = walk(start)
        last = jax.tree.map(lambda leaf: leaf[-1], at.state)
        if not isinstance(scene, jb.RigidScene):
            stands = jnp.abs(last.theta_1) < jnp.abs(last.theta_2)
            other = jb.dynamics.exchange_legs(scene, last)
            last = jax.tree.map(lambda a, b: jnp.where(stands, a, b), other, last)
        return at.t, last._replace(hip_x=0.0 * last.hip_x), at.total

    return jax.vmap(one)(starts)
