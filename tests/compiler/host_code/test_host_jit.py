"""Host compilation, against XLA: what NumPy runs, what is left, what another process finds."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import host_jit
from jaxbiped.compiler.host_code import _host_jit


@host_jit()
def _root(x):
    """Newton's method on y² = x."""
    return jax.lax.fori_loop(0, 20, lambda _, y: 0.5 * (y + x / y), jnp.ones_like(x))


@host_jit(lambda x, on_host: on_host, within=True)
def _doubled(x, on_host):
    return 2.0 * x


@host_jit()
def _error_function(x):
    return jax.lax.erf(x)


def _rigid_gait():
    return jb.find_gait(jb.ladder()["rigid"], parameters=(), radius_sensitivities=False)


def _refuse(*_):
    raise AssertionError("compiled, or written again")


@pytest.fixture
def converted(monkeypatch):
    """Results become arrays of JAX without the one program that all functions share for it."""
    monkeypatch.setattr(_host_jit, "_of_jax", lambda arrays: list(map(jnp.asarray, arrays)))


@pytest.mark.usefixtures("converted")
def test_numpy_runs_it(monkeypatch):
    monkeypatch.setattr(type(_root._jitted), "__call__", _refuse)
    found = _root(np.array([4.0, 2.0]))
    assert isinstance(found, jax.Array)
    np.testing.assert_allclose(found, [2.0, np.sqrt(2.0)], rtol=1e-15)


def test_traced_it_is_xlas():
    found = jax.vmap(_root)(jnp.array([4.0, 9.0]))
    np.testing.assert_allclose(found, [2.0, 3.0], rtol=1e-15)
    slope = jax.jvp(_root, (jnp.asarray(4.0),), (jnp.asarray(1.0),))[1]
    assert float(slope) == pytest.approx(0.25, rel=1e-12)
    assert "scan" in str(jax.make_jaxpr(_root)(jnp.asarray(4.0)))


def test_only_where_it_pays(monkeypatch):
    assert isinstance(_doubled(np.ones(2), False), jax.Array)
    monkeypatch.setattr(type(_doubled._jitted), "__call__", _refuse)
    assert isinstance(_doubled(np.ones(2), True), np.ndarray)


def test_what_numpy_lacks_is_compiled():
    assert float(_error_function(np.asarray(0.5))) == pytest.approx(0.5204998778130465, rel=1e-12)


def test_shapes_are_known_before_it_runs():
    assert _root.begin(np.ones(3)).result.shape == (3,)
    assert _error_function.begin(np.ones(3)).result.shape == (3,)


@pytest.mark.usefixtures("converted")
def test_kept_for_the_next_process(monkeypatch, tmp_path, xla_refuses):
    """A gait search, whose host programs hold programs of lanes; XLA compiles none of it."""
    monkeypatch.setenv("JAXBIPED_CACHE", str(tmp_path))
    xla_refuses()

    jb.clear_caches()
    first = _rigid_gait()
    # The start, the search and what is told of the gait.
    assert len(list((tmp_path / "host").iterdir())) == 3
    jb.clear_caches()

    monkeypatch.setattr(_host_jit, "write_host_program", _refuse)
    second = _rigid_gait()
    for a, b in zip(jax.tree.leaves(first), jax.tree.leaves(second), strict=True):
        np.testing.assert_array_equal(a, b)
    jb.clear_caches()
