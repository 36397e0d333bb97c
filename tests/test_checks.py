"""Bad arguments, against one clear sentence: the argument, its value and what is allowed."""

import errno
import os
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._files import check_writable_directory


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
        (lambda: jb.seed_scene(slope="0.02"), ("slope", "'0.02'", "not a number")),
        (lambda: jb.seed_scene(m=True), ("m", "True", "not a number")),
        (lambda: jb.seed_scene(m=np.bool_(True)), ("m", "True", "not a number")),
        (lambda: jb.seed_scene(m=jnp.asarray(True)), ("m", "True", "not a number")),
        (lambda: jb.laws.Hertz(K=0.0), ("K", "0")),
        (lambda: jb.laws.RegularisedCoulomb(mu=0.4, v_d=-1.0), ("v_d", "-1")),
        (lambda: jb.laws.SmoothRistowSchafer(K=1e6, c=1e7, depth_width=0.0), ("depth_width", "0")),
        (lambda: jb.seed_scene(K=jnp.array([1e6, -1.0])), ("K", "-1")),
    ],
)
def test_scene_arguments(make, words):
    _check_refusal(words, make)


def _check_refusal(words, make, *given, **options):
    with pytest.raises(jb.ArgumentError) as caught:
        make(*given, **options)
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
        ({"footsteps": 0}, ("footsteps", "0", "above 0")),
        ({}, ("duration", "footsteps")),
        ({"duration": 1.0, "rtol": 0.0}, ("rtol", "0")),
        ({"duration": 1.0, "save": "all"}, ("save", "all", "end")),
        ({"duration": 1.0, "watch": ("falls",)}, ("watch", "falls", "stumble")),
        ({"duration": 1.0, "max_solver_steps": 0}, ("max_solver_steps", "0")),
        ({"duration": 1.0, "max_solver_steps": 9.5}, ("max_solver_steps", "9.5", "whole")),
        ({"footsteps": "3"}, ("footsteps", "'3'", "not a number")),
        ({"footsteps": 1.5}, ("footsteps", "1.5", "whole number above 0")),
        ({"footsteps": True}, ("footsteps", "True", "not a number")),
        ({"duration": "1"}, ("duration", "'1'", "not a number")),
        ({"duration": float("inf")}, ("duration", "inf", "finite")),
        ({"duration": jnp.array([1.0, 2.0])}, ("duration", "(2,)", "jax.vmap")),
        ({"duration": [1.0, 2.0]}, ("duration", "(2,)", "jax.vmap")),
        ({"duration": 1.0, "rtol": [1e-6, 1e-7]}, ("rtol", "(2,)", "jax.vmap")),
    ],
)
def test_simulate_arguments(options, words):
    _check_refusal(words, jb.simulate, jb.seed_scene(), jb.seed_state(), **options)


def test_a_start_that_is_no_number_is_refused_by_name():
    start = jb.seed_state()._replace(theta_1=jnp.asarray(float("nan")))
    with pytest.raises(jb.ArgumentError, match=r"state\.theta_1 = nan"):
        jb.simulate(jb.seed_scene(), start, duration=1.0)


def test_a_start_of_mixed_shapes_is_refused():
    start = jb.seed_state()._replace(theta_1=jnp.zeros(3))
    with pytest.raises(jb.ArgumentError, match="shape"):
        jb.simulate(jb.seed_scene(), start, duration=1.0)


_TWO_STARTS = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), jb.seed_state())
_TWO_SCENES = jb.seed_scene(slope=jnp.array([0.01, 0.02]))


@pytest.mark.parametrize(
    ("run", "name"),
    [
        (lambda: jb.simulate(_TWO_SCENES, jb.seed_state(), duration=1.0), "scene.ground.slope"),
        (lambda: jb.simulate(jb.seed_scene(), _TWO_STARTS, duration=1.0), "state.hip_x"),
        (
            lambda: jb.simulate(
                jb.RedundantScene(jb.seed_scene(), "index1"), _TWO_STARTS, duration=1.0
            ),
            "state.hip_x",
        ),
        (
            lambda: jb.rigid_walk(
                jb.RigidScene(_TWO_SCENES.walker, _TWO_SCENES.ground),
                jb.dynamics.rigid_state(jb.seed_state()),
                footsteps=1,
            ),
            "scene.ground.slope",
        ),
        (
            lambda: jb.rigid_walk(
                jb.RigidScene(_TWO_SCENES.walker, jb.seed_scene().ground),
                jb.dynamics.rigid_state(_TWO_STARTS),
                footsteps=1,
            ),
            "state.hip_x",
        ),
    ],
)
def test_batches_are_told_of_vmap(run, name):
    with pytest.raises(jb.ArgumentError, match=r"jax\.vmap") as caught:
        run()
    assert f"{name} has the shape (2,)" in str(caught.value)


def test_traced_values_pass():
    scenes = jax.vmap(lambda K: jb.seed_scene(K=K))(jnp.array([1e5, 1e6]))
    assert scenes.normal.K.shape == (2,)


@pytest.mark.parametrize(
    ("code", "kind"), [(errno.EACCES, jb.ArgumentError), (errno.ENOSPC, jb.ResourceError)]
)
def test_a_path_is_to_blame_for_itself_and_not_for_its_disk(tmp_path, monkeypatch, code, kind):
    def refuse(*_, **__):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(kind, match=rf"out = .* is not allowed \({os.strerror(code).lower()}\)"):
        check_writable_directory("out", tmp_path / "out")
