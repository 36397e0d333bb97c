"""A fusion barrier, against the function without it: nothing else changes."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped.compiler import fusion_barrier


def _compute(x, y):
    return {"product": jnp.sin(x) * y, "count": jnp.asarray(3, jnp.int32), "x": (x,)}


def _behind_fence(x, y, happens=None):
    happens = jnp.isfinite(x) if happens is None else happens
    return fusion_barrier(happens, lambda: _compute(x, y))


X, Y = jnp.asarray(0.7), jnp.asarray(-1.3)


def test_value_is_the_same_bit_for_bit():
    for transform in (lambda f: f, jax.jit):
        mine, plain = transform(_behind_fence)(X, Y), transform(_compute)(X, Y)
        assert jax.tree.structure(mine) == jax.tree.structure(plain)
        for a, b in zip(jax.tree.leaves(mine), jax.tree.leaves(plain), strict=True):
            assert a.dtype == b.dtype
            assert np.array_equal(a, b)


def test_derivatives_pass_through():
    def product(x, y):
        return _behind_fence(x, y)["product"]

    assert np.isclose(jax.grad(product, argnums=0)(X, Y), np.cos(0.7) * -1.3, rtol=1e-15)
    assert np.isclose(jax.jvp(product, (X, Y), (0.0 * X, 1.0 + 0.0 * Y))[1], np.sin(0.7))
    second = jax.jit(jax.jacfwd(jax.grad(product, argnums=0), argnums=1))(X, Y)
    assert np.isclose(second, np.cos(0.7), rtol=1e-15)


def test_vmap_keeps_every_lane_even_where_only_one_wants_it():
    x, y = jnp.linspace(-1.0, 1.0, 5), jnp.linspace(2.0, 3.0, 5)
    happens = jnp.arange(5) == 3
    mine = jax.jit(jax.vmap(_behind_fence))(x, y, happens)
    plain = jax.jit(jax.vmap(_compute))(x, y)
    np.testing.assert_array_equal(mine["product"], plain["product"])
    gradient = jax.vmap(jax.grad(lambda *args: _behind_fence(*args)["product"]))(x, y, happens)
    np.testing.assert_allclose(gradient, np.cos(x) * y, rtol=1e-15)


def test_on_a_cpu_the_work_sits_in_a_conditional():
    """One lane's want is every lane's: under vmap it must stay a branch, not become a select."""
    x = jnp.linspace(-1.0, 1.0, 5)
    program = str(jax.make_jaxpr(jax.vmap(_behind_fence))(x, x, x > 0.0))
    assert (" cond[" in program) == (jax.default_backend() == "cpu")
    assert "select_n" not in program
    nobody = jax.vmap(_behind_fence)(x, x, jnp.zeros(5, bool))
    if jax.default_backend() == "cpu":
        assert not np.any(nobody["product"])
