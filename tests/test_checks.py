"""Bad arguments: one clear sentence that names the argument, its value and what is allowed."""

import jax
import jax.numpy as jnp
import pytest

import jaxbiped as jb


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: jb.seed_scene(K=-1.0), ("K", "-1", "above 0")),
        (lambda: jb.seed_scene(m=-1.0), ("m", "-1", "above 0")),
        (lambda: jb.seed_scene(l=0.05), ("l", "0.05", "at least", "0.08")),
        (lambda: jb.seed_scene(c=float("nan")), ("c", "nan")),
        (lambda: jb.seed_scene(slope=2.0), ("slope", "2", "1.57")),
        (lambda: jb.seed_scene(v0=0.0), ("v0", "0", "above 0")),
        (lambda: jb.seed_scene(xi=-1.0), ("xi", "-1")),
        (lambda: jb.seed_scene(hip_mass="heavy"), ("hip_mass", "heavy", "number")),
        (lambda: jb.Hertz(K=0.0), ("K", "0")),
        (lambda: jb.RegularisedCoulomb(mu=0.4, v_d=-1.0), ("v_d", "-1")),
        (lambda: jb.SmoothRistowSchafer(K=1e6, c=1e7, depth_width=0.0), ("depth_width", "0")),
        (lambda: jb.seed_scene(K=jnp.array([1e6, -1.0])), ("K", "-1")),
    ],
)
def test_scene_arguments(make, words):
    with pytest.raises(jb.ArgumentError) as caught:
        make()
    message = str(caught.value)
    assert all(word in message for word in words)
    assert "\n" not in message


def test_a_scene_of_wrong_parts_is_refused():
    scene = jb.seed_scene()
    with pytest.raises(jb.ArgumentError, match="friction"):
        jb.Scene(scene.walker, scene.ground, scene.normal, scene.normal)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"duration": 1.0, "solver": "euler9"}, ("solver", "euler9", "rodas4")),
        ({"duration": 1.0, "accuracy": "best"}, ("accuracy", "best", "tight")),
        ({"duration": -1.0}, ("duration", "-1", "above 0")),
        ({"duration": float("nan")}, ("duration", "nan")),
        ({"steps": 0}, ("steps", "0", "above 0")),
        ({}, ("duration", "steps")),
        ({"duration": 1.0, "rtol": 0.0}, ("rtol", "0")),
        ({"duration": 1.0, "save": "all"}, ("save", "all", "end")),
        ({"duration": 1.0, "watch": ("falls",)}, ("watch", "falls", "stumble")),
        ({"duration": 1.0, "max_solver_steps": 0}, ("max_solver_steps", "0")),
    ],
)
def test_simulate_arguments(options, words):
    with pytest.raises(jb.ArgumentError) as caught:
        jb.simulate(jb.seed_scene(), jb.seed_state(), **options)
    assert all(word in str(caught.value) for word in words)


def test_a_start_that_is_no_number_is_refused_by_name():
    start = jb.seed_state()._replace(theta_1=jnp.asarray(float("nan")))
    with pytest.raises(jb.ArgumentError, match=r"state\.theta_1 = nan"):
        jb.simulate(jb.seed_scene(), start, duration=1.0)


def test_a_start_of_mixed_shapes_is_refused():
    start = jb.seed_state()._replace(theta_1=jnp.zeros(3))
    with pytest.raises(jb.ArgumentError, match="shape"):
        jb.simulate(jb.seed_scene(), start, duration=1.0)


def test_traced_values_pass():
    scenes = jax.vmap(lambda K: jb.seed_scene(K=K))(jnp.array([1e5, 1e6]))
    assert scenes.normal.K.shape == (2,)
