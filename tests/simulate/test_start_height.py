"""Starts below the ground, against a sentence before anything is compiled."""

import dataclasses

import jax
import jax.numpy as jnp
import pytest

import jaxbiped as jb
from jaxbiped.simulate._start import check_start_height

SEED = jb.seed_scene()


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
    for state in (start, jb.dynamics.BristleState(*start, jnp.zeros(()), jnp.zeros(()))):
        with pytest.raises(jb.ArgumentError) as caught:
            check_start_height(scene, state)
        assert all(word in str(caught.value) for word in words)
    with pytest.raises(jb.ArgumentError, match="below the"):
        jb.simulate(scene, start, duration=1.0)
    with pytest.raises(jb.ArgumentError, match="below the"):
        jb.simulate(jb.RedundantScene(scene), start, duration=1.0)


def test_the_foot_that_would_just_touch_is_named_by_a_height_at_which_it_does():
    with pytest.raises(jb.ArgumentError) as caught:
        check_start_height(SEED, _start(hip_z=0.2))
    height = float(str(caught.value).split("hip_z = ")[-1].rstrip("."))
    foot = jb.dynamics.feet(SEED, _start(hip_z=height)).foot_2
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
    check_start_height(scene, start)


def test_what_is_traced_passes():
    jax.make_jaxpr(lambda z: check_start_height(SEED, _start()._replace(hip_z=z)))(0.2)
