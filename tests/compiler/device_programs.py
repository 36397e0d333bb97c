"""What runs on devices: each kind of program, by an engine's name."""

import jax
import jax.numpy as jnp
import numpy as np

import jaxbiped as jb
from tests.rigid_walkers import rigid_seed, simplest_state
from tests.sweep.walkers import gaitless, stacked, with_attractor

COUNT = 6
_TIME = 0.15
RATES = np.linspace(-1.4, -0.9, COUNT)


def _walks(engine, **options):
    scene, state = jb.seed_scene(slope=0.02), jb.seed_state()

    def walk(rate):
        how = dict(duration=_TIME, accuracy="draft", engine=engine) | options
        return jb.simulate(scene, state._replace(omega_2=rate), **how)

    found = jax.vmap(walk)(jnp.asarray(RATES))
    kept = found.t, found.state, found.ending, found.accepted, found.lowest, found.highest
    arrivals = found.arrivals
    return kept if arrivals is None else (*kept, arrivals.t, arrivals.state, arrivals.total)


def end(engine):
    return _walks(engine, save="end")


def steps(engine):
    walk = jb.simulate(jb.seed_scene(), jb.seed_state(), duration=_TIME, engine=engine)
    assert walk.engine == engine
    return walk.t, walk.state, walk.ending


def gradient(engine):
    """In reverse mode."""
    scene, state = jb.seed_scene(slope=0.02), jb.seed_state()

    def final(rate):
        how = dict(duration=_TIME, save="end", accuracy="draft", engine=engine)
        return jb.simulate(scene, state._replace(omega_2=rate), **how).state.hip_x[0]

    return jax.grad(final)(-1.2)


def times(engine):
    return _walks(engine, save=jnp.linspace(0.01, _TIME, 4))


def arrivals(engine):
    return _walks(engine, save=jb.MidStance(), max_arrivals=3)


def extremes(engine):
    return _walks(engine, save="end", footsteps=1, extremes=lambda _, state: state.hip_z)


def tangents(engine):
    scene, state = jb.seed_scene(slope=0.02), jb.seed_state()

    def final(stiffness, rate):
        moved = jb.seed_scene(slope=0.02, K=stiffness)
        start = state._replace(omega_2=rate)
        how = dict(duration=_TIME, save="end", accuracy="draft", engine=engine)
        return jb.simulate(moved, start, **how).state

    stiffness = jnp.full(COUNT, scene.normal.K)
    return jax.vmap(jax.jacfwd(final, argnums=(0, 1)))(stiffness, jnp.asarray(RATES))


def rigid(engine):
    start = jb.dynamics.RigidState(*map(jnp.asarray, (0.0, -0.24, 0.24, -1.089, -1.643)))
    found = jb.rigid_walk(rigid_seed(), start, footsteps=2, max_arrivals=2, engine=engine)
    return found.t, found.state, found.ending, found.arrivals.t, found.arrivals.state


def labels(engine):
    scene, state = jb.seed_scene(), jb.seed_state()
    given = {name: np.full(COUNT, float(leaf)) for name, leaf in state._asdict().items()}
    starts = type(state)(**(given | {"omega_2": np.linspace(-3.0, -1.0, COUNT)}))
    known = gaitless(scene, state, engine=engine, footsteps=1, accuracy="draft")
    return [*with_attractor(known)(starts)][:-1]


def rigid_labels(engine):
    known = gaitless(rigid_seed(), simplest_state(0.2, -1.2), engine=engine, footsteps=2)
    angles = np.linspace(0.1, 0.3, COUNT)
    return [*with_attractor(known)(stacked([simplest_state(angle, -1.2) for angle in angles]))][:-1]


CASES = {
    each.__name__: each
    for each in (
        *(end, steps, gradient, times, arrivals, extremes, tangents),
        *(labels, rigid, rigid_labels),
    )
}
