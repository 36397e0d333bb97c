"""Motions densely sampled by lanes, and the footsteps in them."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb

COUNT = 600_001
"""Times in a motion, always as many, so that scenes of one kind share one program."""
RTOL = 1e-8
"""Of the solver, so that what is drawn between its steps is smooth."""
SHOWN = 2000
"""Points of a curve, evenly spaced; as many again by the logarithm of time."""


class Motion(NamedTuple):
    """A motion at times t (n,) [s]: kinetic energy (n,); for each leg rows (2, n). SI units.

    Of one foot from its heel strike to the next, times are since the strike, and rows (n,).
    """

    t: np.ndarray
    kinetic: np.ndarray
    angle: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    tangential: np.ndarray
    slip: np.ndarray
    outcome: str


def motion(scene, duration):
    """From the seed's start, until it ends."""
    how = dict(rtol=RTOL, save=jnp.linspace(0.0, duration, COUNT), engine="lanes")
    walk = jb.simulate(scene, jb.seed_state(), duration=duration, **how)
    saved = np.isfinite(np.asarray(walk.t))
    rows = {name: np.asarray(row)[..., saved] for name, row in _rows(scene, walk.state).items()}
    return Motion(t=np.asarray(walk.t)[saved], outcome=str(walk.outcome), **rows)


@eqx.filter_jit
def _rows(scene, state):
    both, forces = jb.dynamics.feet(scene, state), jb.dynamics.foot_forces(scene, state)
    nothing = jnp.zeros_like(state.theta_1)
    tangential = [nothing if each.tangential is None else each.tangential for each in forces]
    return {
        "kinetic": jb.dynamics.energies(scene, state).kinetic,
        "angle": jnp.stack([state.theta_1, state.theta_2]),
        "depth": jnp.stack([jnp.where(jb.dynamics.touches(f), f.penetration, 0.0) for f in both]),
        "normal": jnp.stack([each.normal for each in forces]),
        "tangential": jnp.stack(tangential),
        "slip": jnp.stack([foot.slip_speed for foot in both]),
    }


def strikes(found):
    """Places and legs (0 or 1) where the leg ahead begins to carry, the other having struck."""
    loaded = found.normal > 0.0
    begins = ~loaded[:, :-1] & loaded[:, 1:] & (found.angle[:, 1:] > 0.0)
    last, struck = int(np.argmax(loaded[:, 0])), []
    for place in map(int, np.flatnonzero(begins.any(axis=0)) + 1):
        leg = 1 - last
        if begins[leg, place - 1]:
            struck.append((place, leg))
            last = leg
    return struck


def first_stance(found):
    """One foot from the first heel strike to the second or to the end; None without a strike."""
    struck = strikes(found)
    if not struck:
        return None
    begin, leg = struck[0]
    size = (struck[1][0] if len(struck) > 1 else len(found.t)) - begin
    logarithmic = np.geomspace(1, size - 1, SHOWN).astype(int)
    shown = np.unique(np.concatenate([np.linspace(0, size - 1, SHOWN).astype(int), logarithmic]))
    places = begin + shown
    names = ("angle", "depth", "normal", "tangential", "slip")
    rows = {name: getattr(found, name)[leg, places] for name in names}
    # The foot touched between the last time without a load and the first with one.
    touched = 0.5 * (found.t[begin - 1] + found.t[begin])
    return found._replace(t=found.t[places] - touched, kinetic=found.kinetic[places], **rows)


def largest(found, rows):
    """Largest value in rows (2, n) from each heel strike to the next or to the end."""
    places = [place for place, _ in strikes(found)]
    ends = [*places[1:], len(found.t)]
    return [float(rows[:, a:b].max()) for a, b in zip(places, ends, strict=True)]
