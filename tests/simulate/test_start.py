"""Starts: their precision, against that of the solve; below the ground, against a sentence."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb

SEED = jb.seed_scene()
WIDTHS = {
    "NumPy scalars": np.float32,
    "NumPy arrays": lambda x: np.asarray(x, dtype=np.float32),
    "JAX arrays": lambda x: jnp.asarray(x, dtype=jnp.float32),
}


def begun(scene, state):
    """The start of a simulation, checked and converted."""
    return jb.Simulation.prepare(scene, state, duration=1.0).state


@pytest.mark.parametrize("kind", WIDTHS)
def test_a_start_in_float32_stays_so(kind):
    start = begun(SEED, jb.State(*[WIDTHS[kind](float(x)) for x in jb.seed_state()]))
    assert {leaf.dtype for leaf in start} == {np.dtype("float32")}


def test_one_leaf_in_float32_loses_nothing_of_the_others():
    for field in ("hip_x", "theta_1"):
        start = begun(SEED, jb.seed_state()._replace(**{field: np.float32(0.1)}))
        assert {leaf.dtype for leaf in start} == {np.dtype("float64")}


def test_a_redundant_start_is_put_on_its_constraints_in_64_bits():
    start = begun(jb.RedundantScene(SEED), jax.tree.map(np.float32, jb.seed_state()))
    assert {leaf.dtype for leaf in start} == {np.dtype("float64")}


def test_plain_numbers_are_float64():
    start = begun(SEED, jb.State(*map(float, jb.seed_state())))
    assert {leaf.dtype for leaf in start} == {np.dtype("float64")}


def _start(**values):
    return jb.seed_state()._replace(**{name: jnp.asarray(x) for name, x in values.items()})


@pytest.mark.parametrize(
    ("scene", "start", "words"),
    [
        (SEED, _start(hip_z=0.2), ("hip_z = 0.2", "foot 2", "0.196 m below", "0.3956")),
        (SEED, _start(hip_z=0.0), ("hip_z = 0", "below the ground")),
        (SEED, _start(hip_z=-5.0), ("hip_z = -5", "below the ground")),
        (jb.seed_scene(K=1e12), _start(), ("0.000628 m below", "3.95e+03 J", "0.3956275")),
        # So soft that little is stored, yet half a leg deep.
        (jb.seed_scene(K=10.0), _start(hip_z=0.2), ("foot 2", "0.196 m below")),
    ],
)
def test_refused(scene, start, words):
    with_bristles = dataclasses.replace(scene, friction=jb.ladder()["bristles"].friction)
    for each in (scene, with_bristles):
        with pytest.raises(jb.ArgumentError) as caught:
            begun(each, start)
        assert all(word in str(caught.value) for word in words)
    with pytest.raises(jb.ArgumentError, match="below the"):
        jb.simulate(scene, start, duration=1.0)
    with pytest.raises(jb.ArgumentError, match="below the"):
        jb.simulate(jb.RedundantScene(scene), start, duration=1.0)


def test_the_foot_that_would_just_touch_is_named_by_a_height_at_which_it_does():
    with pytest.raises(jb.ArgumentError) as caught:
        begun(SEED, _start(hip_z=0.2))
    height = float(str(caught.value).split("hip_z = ")[-1].rstrip("."))
    foot = jb.dynamics.feet(SEED, _start(hip_z=height))[1]
    assert float(foot.penetration) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("scene", "start"),
    [
        (SEED, _start()),
        (SEED, _start(hip_z=100.0)),
        (jb.seed_scene(K=1e9), _start()),
        # The foot that passes below the surface is the swinging one, which nothing touches.
        (jb.seed_scene(K=1e12), _start(hip_z=0.3957, theta_1=0.0, omega_1=0.5)),
        (dataclasses.replace(SEED, clearance=jb.laws.OneFoot(1)), _start(hip_z=0.37, theta_1=-0.5)),
    ],
)
def test_allowed(scene, start):
    begun(scene, start)


def test_what_is_traced_passes():
    jax.eval_shape(lambda z: begun(SEED, _start()._replace(hip_z=z)), 0.2)
