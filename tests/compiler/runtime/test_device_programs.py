"""Programs of walks and labels on devices, against the lanes' bits; registers and spills."""

import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import ARCHITECTURES, ptx_text
from tests.compiler.assembler import assembled
from tests.compiler.fake_driver import install
from tests.mechanisms import scene_of, start_of
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


def modes(engine):
    """Knees that lock and are struck, on rigid feet."""
    scene = jb.models.hsu_chen()
    start = scene.state(
        theta_thigh_1=-0.24, theta_shank_1=-0.3, theta_thigh_2=0.24, theta_shank_2=0.24,
        omega_thigh_2=-1.11, omega_shank_2=-1.11, held="shank_2",
    )  # fmt: skip
    found = jb.rigid_walk(scene, start, footsteps=2, max_arrivals=2, engine=engine)
    return found.t, found.state, found.ending, found.arrivals.t, found.arrivals.state


def mechanism(engine):
    """Knees with compliant stops, on compliant feet."""
    scene = scene_of("kneed")
    start = start_of("kneed", scene)

    def walk(speed):
        how = dict(duration=_TIME, save="end", accuracy="draft", engine=engine)
        return jb.simulate(scene, start._replace(hip_vx=speed), **how)

    found = jax.vmap(walk)(jnp.linspace(0.25, 0.35, COUNT))
    return found.t, found.state, found.ending, found.accepted


PROGRAMS = (
    end, steps, gradient, times, arrivals, extremes, tangents, labels, rigid, rigid_labels, modes,
    mechanism,
)  # fmt: skip
CASES = {each.__name__: each for each in PROGRAMS}

LANDING = ("labels", "rigid")
"""One of each engine's programs that a change waits for; the others are run at night."""
MOST = {
    "end": (255, 804, 1056),
    "steps": (255, 812, 1084),
    "times": (255, 856, 1120),
    "arrivals": (255, 836, 1136),
    "extremes": (255, 912, 1192),
    "tangents": (255, 6572, 11428),
    "labels": (255, 2560, 3976),
    "rigid": (218, 0, 0),
    "rigid_labels": (255, 612, 564),
}
"""Registers of a thread, bytes that are stored to and loaded from memory for want of them:
on sm_90, by `ptxas` 12.9."""
_SLACK = 1.25
"""For other devices, and other versions of LLVM and of the assembler."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in LANDING else pytest.mark.nightly)
        for name in CASES
    ],
)
def test_lanes_bits_and_registers(monkeypatch, name):
    fake = install(monkeypatch, lanes=4, multiprocessors=1)
    found, expected = CASES[name]("cuda"), CASES[name]("lanes")
    assert fake.launches
    for a, b in zip(jtu.tree_leaves(found), jtu.tree_leaves(expected), strict=True):
        np.testing.assert_array_equal(a, b)
    # A gradient's programs are those of the end and of tangents.
    registers, stores, loads = MOST.get(name, (0, 0, 0))
    for text in fake.modules if name in MOST else ():
        for architecture in ARCHITECTURES.values():
            taken = assembled(ptx_text(text, architecture), architecture)
            print(name, architecture.name, taken)
            assert taken["registers"] <= max(registers, 255)
            assert taken["spill_stores"] <= _SLACK * stores + 64
            assert taken["spill_loads"] <= _SLACK * loads + 64
