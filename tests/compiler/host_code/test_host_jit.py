"""Host compilation, against XLA: what NumPy runs, what is left, what another process finds."""

import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import host_jit


@host_jit()
def _root(x):
    """Newton's method on y² = x."""
    return jax.lax.fori_loop(0, 20, lambda _, y: 0.5 * (y + x / y), jnp.ones_like(x))


@host_jit(lambda x, on_host: on_host, within=True)
def _doubled(x, on_host):
    return 2.0 * x


@host_jit()
def _doubled_for_users(x):
    return 2.0 * x


@host_jit()
def _error_function(x):
    return jax.lax.erf(x)


def _rigid_gait():
    return jb.find_gait(jb.ladder()["rigid"], parameters=(), radius_sensitivities=False)


def test_numpy_runs_it(made_by_xla):
    """XLA makes the one program by which all functions convert a result of that shape."""
    assert isinstance(_doubled_for_users(np.ones(2)), jax.Array)
    made_by_xla()
    found = _root(np.array([4.0, 2.0]))
    assert made_by_xla() == []
    assert isinstance(found, jax.Array)
    np.testing.assert_allclose(found, [2.0, np.sqrt(2.0)], rtol=1e-15)


def test_traced_it_is_xlas():
    found = jax.vmap(_root)(jnp.array([4.0, 9.0]))
    np.testing.assert_allclose(found, [2.0, 3.0], rtol=1e-15)
    slope = jax.jvp(_root, (jnp.asarray(4.0),), (jnp.asarray(1.0),))[1]
    assert float(slope) == pytest.approx(0.25, rel=1e-12)
    assert "scan" in str(jax.make_jaxpr(_root)(jnp.asarray(4.0)))


def test_only_where_it_pays(made_by_xla):
    assert isinstance(_doubled(np.ones(2), False), jax.Array)
    made_by_xla()
    assert isinstance(_doubled(np.ones(2), True), np.ndarray)
    assert made_by_xla() == []


def test_what_numpy_lacks_is_compiled():
    assert float(_error_function(np.asarray(0.5))) == pytest.approx(0.5204998778130465, rel=1e-12)


def test_shapes_are_known_before_it_runs():
    assert _root.begin(np.ones(3)).result.shape == (3,)
    assert _error_function.begin(np.ones(3)).result.shape == (3,)


def test_kept_for_the_next_process(monkeypatch, tmp_path, made_by_xla):
    """A gait search, whose host programs hold programs of lanes; XLA converts their results."""
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path / "cache"))
    jb.clear_caches()
    first = _rigid_gait()
    # The start, the search and what is told of the gait.
    written = list((tmp_path / "cache" / "host").iterdir())
    assert len(written) == 3
    assert made_by_xla().count("backend_compile_duration") <= 3
    for path in written:
        os.link(path, tmp_path / path.name)
    jb.clear_caches()

    second = _rigid_gait()
    assert made_by_xla() == []
    # What is written again is a new file.
    assert all(path.samefile(tmp_path / path.name) for path in written)
    for a, b in zip(jax.tree.leaves(first), jax.tree.leaves(second), strict=True):
        np.testing.assert_array_equal(a, b)
    jb.clear_caches()
