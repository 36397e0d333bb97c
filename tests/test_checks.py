"""Bad arguments, against one clear sentence: the argument, its value and what is allowed."""

import contextlib
import errno
import functools
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped._checks import check_type, warn
from jaxbiped._files import check_writable_directory, read_csv, user_path


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
        (lambda: jb.seed_scene(m=object()), ("m", "object", "not a number")),
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
        ({"duration": jnp.array([1.0, 2.0])}, ("duration", "(2,)", "jax.vmap")),
        ({"duration": [1.0, 2.0]}, ("duration", "(2,)", "jax.vmap")),
        ({"duration": 1.0, "rtol": [1e-6, 1e-7]}, ("rtol", "(2,)", "jax.vmap")),
    ],
)
def test_arguments_that_want_vmap(options, words):
    _check_refusal(words, jb.simulate, jb.seed_scene(), jb.seed_state(), **options)


_TWO_STARTS = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), jb.seed_state())
_TWO_SCENES = jb.seed_scene(slope=jnp.array([0.01, 0.02]))


def _walk(scene, state):
    jb.simulate(scene, state, duration=1.0)


def _roll(scene, state):
    rigid = jb.RigidScene(jb.seed_scene().walker, scene.ground)
    jb.rigid_walk(rigid, jb.dynamics.rigid_state(state), footsteps=1)


@pytest.mark.parametrize(
    ("angle", "words"), [(float("nan"), r"state\.theta_1 = nan"), (jnp.zeros(3), "shape")]
)
def test_a_start_that_is_no_number_or_of_mixed_shapes_is_refused(angle, words):
    with pytest.raises(jb.ArgumentError, match=words):
        _walk(jb.seed_scene(), jb.seed_state()._replace(theta_1=jnp.asarray(angle)))


@pytest.mark.parametrize(
    ("run", "scene", "state", "name"),
    [
        (_walk, _TWO_SCENES, jb.seed_state(), "scene.ground.slope"),
        (_walk, jb.seed_scene(), _TWO_STARTS, "state.hip_x"),
        (_walk, jb.RedundantScene(jb.seed_scene(), "index1"), _TWO_STARTS, "state.hip_x"),
        (_roll, _TWO_SCENES, jb.seed_state(), "scene.ground.slope"),
        (_roll, jb.seed_scene(), _TWO_STARTS, "state.hip_x"),
    ],
)
def test_batches_are_told_of_vmap(run, scene, state, name):
    with pytest.raises(jb.ArgumentError, match=r"jax\.vmap") as caught:
        run(scene, state)
    assert f"{name} has the shape (2,)" in str(caught.value)


def test_a_type_that_is_asked_for_has_its_article():
    for kinds, said in (
        ((jb.Ending, jb.State), "it must be an Ending or a State."),
        ((jb.Scene,), "it must be a Scene."),
    ):
        with pytest.raises(jb.ArgumentError, match=f"^it = 3 is not allowed: {said}$"):
            check_type("it", 3, *kinds)
    with pytest.raises(jb.ArgumentError, match=r"^it = a str is not allowed"):
        check_type("it", 80 * "long", jb.Scene)


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


@pytest.mark.parametrize(
    ("address", "path"),
    [
        ("file:///a%20b/c#d?e", "/a b/c#d?e"), ("file://localhost/a", "/a"), ("file:/a", "/a"),
        ("file:a/b", "a/b"), (Path("file:///a"), "/a"), ("a/b", "a/b"),
    ],
)  # fmt: skip
def test_an_address_of_a_file_is_its_path(address, path):
    assert user_path(address) == Path(path)


@pytest.mark.parametrize("address", ["file://machine/a", "file://a", 3, None])
def test_a_file_of_another_machine_is_refused(address):
    with pytest.raises(jb.ArgumentError, match="is not allowed"):
        user_path(address)


def test_a_warning_names_the_callers_line_through_decorators_and_threads():
    """Between the package and its caller may lie Python's library and JAX."""
    names = {"__name__": "jaxbiped.somewhere", "warn": warn, "contextlib": contextlib}
    exec(
        "@contextlib.contextmanager\n"
        "def within():\n"
        "    yield\n"
        "@within()\n"
        "def door(x):\n"
        "    warn('look here')\n"
        "    return x\n",
        names,
    )
    door = names["door"]
    calls = (
        lambda: door(1.0),
        lambda: functools.partial(door, 1.0)(),
        lambda: jax.jit(door)(1.0),
        lambda: jax.vmap(door)(jnp.ones(2)),
    )

    def call_all():
        with ThreadPoolExecutor(1) as pool:
            for call in calls:
                call()
                pool.submit(call).result()

    with pytest.warns(RuntimeWarning, match="look here") as caught:
        call_all()
    line = test_a_warning_names_the_callers_line_through_decorators_and_threads.__code__
    assert {warning.filename for warning in caught} == {__file__}
    assert all(warning.lineno > line.co_firstlineno for warning in caught)
    assert len({warning.lineno for warning in caught}) == len(calls)


def test_a_law_with_an_array_is_told_to_have_numbers():
    class Weighted(eqx.Module):
        """Weights as one array."""

        weights: jax.Array

        def __call__(self, motion):
            return jnp.sum(self.weights) * motion.angle

    walker = jb.Mechanism(
        bodies=[jb.Body(f"leg_{i}", mass=1.0, inertia=0.01, centre=0.1) for i in (1, 2)],
        feet=[jb.Foot(f"leg_{i}", centre=0.3, radius=0.05) for i in (1, 2)],
        joints=[jb.Motor({"leg_1": 1, "leg_2": -1}, Weighted(jnp.ones(3)))],
        mirror=(("leg_1", "leg_2"),),
    )
    scene = jb.RigidScene(walker, jb.Ground(slope=0.02))
    with pytest.raises(jb.ArgumentError, match=r"law.weights has the shape .* a tuple of numbers"):
        jb.rigid_walk(scene, scene.state(omega_leg_2=-1.0), duration=0.1)


def table(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_text(text)
    return read_csv("starts", path)


@pytest.mark.parametrize("rest", ["", ",", ",,"])
def test_a_table_may_have_a_single_column(tmp_path, rest):
    """It needs no comma, and may have some behind it."""
    lines = [f"theta_1{rest}", f"0.1{rest}", f"-0.2{rest}"]
    rows = table(tmp_path, "\n".join(lines))
    assert rows == [(1, ["theta_1"]), (2, ["0.1"]), (3, ["-0.2"])]


@pytest.mark.parametrize("separator", [";", "\t"])
def test_columns_that_no_comma_separates_are_not_taken_for_one(tmp_path, separator):
    with pytest.raises(jb.ArgumentError, match="line 1 has 1 cells, and the header 1: separate"):
        table(tmp_path, f"theta_1{separator}theta_2\n0.1{separator}0.2")
