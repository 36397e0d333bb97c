"""Compiled once for all processes, against the function: what is kept and found again."""

import os
import pickle
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.caching._cached_jit import Skeleton, _without_noise, cached_jit
from jaxbiped.caching._disk_cache import disk_use
from jaxbiped.simulate._backends import by_xla
from jaxbiped.solve.controllers._wrapped_control import just_before_end


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    just_before_end.clear()
    yield tmp_path / "cache" / "xla"
    just_before_end.clear()


LOWERED_AND_COMPILED = ["jaxpr_to_mlir_module_duration", "backend_compile_duration"]


def test_what_was_compiled_is_loaded(cache, made_by_xla):
    given = np.float64(2.0), np.float64(-3.0)
    first = just_before_end(given[0])
    assert made_by_xla() == LOWERED_AND_COMPILED
    (kept,) = cache.iterdir()
    just_before_end.clear()
    again, below = map(just_before_end, given)
    assert made_by_xla() == []
    assert float(again) == float(first) < 2.0
    assert float(below) < -3.0
    assert list(cache.iterdir()) == [kept]


def test_a_walk_by_xla_is_loaded(cache, made_by_xla):
    """diffrax's checks are calls back to Python, with which a program could not be kept."""

    def walk():
        how = dict(solver="euler", dt=1e-6, save="end", watch=(), engine="xla", duration=2e-6)
        scene, start = jb.seed_scene(), jb.seed_state()
        return jb.Simulation.prepare(scene, start, **how)().final

    by_xla.clear()
    first = walk()
    assert made_by_xla()[-2:] == LOWERED_AND_COMPILED
    by_xla.clear()
    again = walk()
    assert made_by_xla() == []
    assert again == first
    by_xla.clear()


@pytest.mark.parametrize("damage", ["emptied", "garbage", "gone", "foreign"])
def test_what_is_damaged_is_compiled_again(cache, damage):
    first = just_before_end(np.float64(2.0))
    (kept,) = cache.iterdir()
    whole = kept.read_bytes()
    if damage == "gone":
        kept.unlink()
    elif damage == "foreign":
        kept.chmod(0o666)
    else:
        kept.write_bytes(b"" if damage == "emptied" else bytes(5000))
    just_before_end.clear()
    assert just_before_end(np.float64(2.0)) == first
    assert len(kept.read_bytes()) == pytest.approx(len(whole), rel=0.2)
    assert kept.stat().st_mode & 0o022 == 0


def test_other_shapes_types_and_settings_are_other_programs(cache):
    for given in (np.float64(2.0), np.array([1.0, 2.0]), jnp.ones(2), jnp.ones(())):
        assert np.all(just_before_end(given) < given)
    assert len(list(cache.iterdir())) == 2
    just_before_end(jnp.asarray(2.0))  # of a weak type
    assert len(list(cache.iterdir())) == 3
    with jax.default_matmul_precision("highest"):
        just_before_end(np.float64(2.0))
    assert len(list(cache.iterdir())) == 4


@pytest.mark.parametrize("numbers", [(1, 1.0), (1.0, 1), (0, False)])
def test_equal_numbers_of_other_types_are_other_programs(cache, numbers):
    """A number that is compiled in, equal to another, makes a result of its own type."""
    joined = cached_jit(jnp.append)
    with jax.numpy_dtype_promotion("standard"):
        kinds = [joined(jnp.zeros(3, bool), number).dtype for number in numbers]
    assert kinds == [jnp.asarray(number).dtype for number in numbers]


def test_traced_and_transformed_it_is_a_part_of_the_whole(cache):
    np.testing.assert_array_equal(
        jax.jit(jax.vmap(just_before_end))(jnp.ones(3)), np.full(3, just_before_end(jnp.ones(())))
    )


def test_alone_it_is_one_program_and_traced_a_part_of_the_whole(cache):
    """An energy by itself; its numbers are plain, and not compiled in."""
    scene, plain = jb.seed_scene(), jb.State(*[float(leaf) for leaf in jb.seed_state()])
    found = jb.dynamics.energies(scene, plain)
    kept = sorted(cache.iterdir())
    assert disk_use()["host"].entries == 1
    still = dict.fromkeys(("hip_vx", "hip_vz", "omega_1", "omega_2"), 0.0)
    assert jb.dynamics.energies(scene, plain._replace(**still)).kinetic == 0.0 < found.kinetic
    assert sorted(cache.iterdir()) == kept
    of = jb.dynamics.energies
    traced, plainly = (jax.make_jaxpr(f)(scene, jb.seed_state()) for f in (of, of.__wrapped__))
    assert [e.primitive for e in traced.eqns] == [e.primitive for e in plainly.eqns]
    whole = jax.jit(jb.dynamics.energies)(scene, jb.seed_state())
    np.testing.assert_allclose(found.kinetic, whole.kinetic, rtol=1e-14)


def test_functions_of_a_notebook_are_compiled_as_ever(cache):
    @cached_jit
    def double(x, name="a"):
        return 2.0 * x, name

    value, name = double(jnp.ones(2), name="b")
    np.testing.assert_array_equal(value, [2.0, 2.0])
    assert name == "b"
    assert disk_use()["xla"].entries == 0
    begun = double.begin(jnp.ones(3))
    assert begun.result[0].shape == (3,)
    begun.finish()


def test_without_a_cache_it_is_compiled_as_ever(cache, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", "")
    assert just_before_end(np.float64(2.0)) < 2.0
    assert not cache.exists()


def test_beside_the_cache_of_jax_none_is_kept_twice(cache, tmp_path, monkeypatch):
    """Kept again, what JAX loaded from its own would fail where it is run."""
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "jax"))
    program = """
from jaxbiped.solve.controllers._wrapped_control import just_before_end
print(float(just_before_end(2.0)) < 2.0)
"""
    for _ in range(3):
        told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
        assert told.stdout == "True\n", told.stderr
    assert not cache.exists() or not list(cache.iterdir())


def test_its_shape_is_known_before_and_after(cache):
    before, finish = just_before_end.begin(np.ones(3))[::-1]
    finish()
    just_before_end.clear()
    after = just_before_end.begin(np.ones(3)).result
    assert (before.shape, before.dtype) == (after.shape, after.dtype) == ((3,), np.float64)


def test_what_was_called_or_begun_is_not_lowered_again(cache, made_by_xla):
    just_before_end.begin(np.ones(3)).finish()
    just_before_end(np.ones(4))
    assert made_by_xla() == 2 * LOWERED_AND_COMPILED
    for n in (3, 4):
        begun = just_before_end.begin(np.ones(n))
        begun.finish()
        assert begun.result.shape == (n,)
    assert made_by_xla() == []


WALK = """
import jaxbiped as jb
from jaxbiped.caching import _cached_jit
from jaxbiped.compiler.runtime import _kernel
import sys
if sys.argv[1] == "loads":
    def refuse(*_):
        raise AssertionError("traced again")
    _kernel.graph_of = _cached_jit.trace_call = refuse
scene = jb.seed_scene(slope=float(sys.argv[2]))
walk = jb.simulate(scene, jb.seed_state(), footsteps=2, accuracy="draft")
gait = jb.find_gait(scene, accuracy="draft", radius_sensitivities=False)
print(walk.engine, walk.outcome, float(walk.t[-1]).hex(), float(gait.measures.period).hex())
"""


@pytest.mark.nightly
def test_another_process_runs_what_one_compiled(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path))

    def run(how, slope):
        command = [sys.executable, "-c", WALK, how, slope]
        told = subprocess.run(command, capture_output=True, text=True)
        assert told.returncode == 0, told.stderr
        assert told.stderr == ""
        return told.stdout

    first = run("compiles", "0.02")
    assert run("loads", "0.02") == first
    other = run("loads", "0.022")
    assert other.startswith("lanes walking")
    scene = jb.seed_scene(slope=0.022)
    walk = jb.simulate(scene, jb.seed_state(), footsteps=2, accuracy="draft")
    assert float(walk.t[-1]).hex() == other.split()[2]


def test_one_wrong_alarm_of_xla_is_kept_away_and_all_else_arrives(capfd):
    def alarmed():
        with _without_noise():
            for line in (b"before\n", b"E0000 cpu_aot_loader.cc:1] a feature\n", b"behind\n"):
                os.write(2, line)
            raise ValueError("as it was")

    with pytest.raises(ValueError, match="as it was"):
        alarmed()
    os.write(2, b"later\n")
    assert capfd.readouterr().err == "before\nbehind\nlater\n"


def test_a_skeleton_is_filled_with_arrays_in_their_order():
    tree = {"a": (jnp.ones(2), "word"), "b": [np.zeros((3, 1), np.float32), 4]}
    skeleton, arrays = Skeleton.of(tree)
    assert [each.shape for each in arrays] == [(2,), (3, 1)]
    assert skeleton.tree["a"][1] == "word"
    assert [(each.shape, each.dtype) for each in skeleton.places] == [
        ((2,), np.dtype("float64")), ((3, 1), np.dtype("float32")),
    ]  # fmt: skip
    assert skeleton.filled([7, 8]) == {"a": (7, "word"), "b": [8, 4]}
    again = pickle.loads(pickle.dumps(skeleton))
    assert again == skeleton
    shapes = skeleton.shapes()
    assert (shapes["a"][0].shape, shapes["b"][1]) == ((2,), 4)
