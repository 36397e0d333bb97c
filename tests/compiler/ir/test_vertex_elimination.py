"""Jacobians by elimination, against those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler.ir import _vertex_elimination
from jaxbiped.compiler.ir._graph import Block
from jaxbiped.compiler.ir._liveness import Liveness
from jaxbiped.compiler.ir._vertex_elimination import jacobian
from jaxbiped.compiler.runtime._program import inputs_of, lower_function

POINT = [0.7, -1.3, 2.1]


def _mixed(z):
    a, b, c = z
    d = jnp.where(a > 0.0, a * b, jnp.exp(c))
    e = jax.jit(lambda x, y: jnp.sin(x) * y / (1.0 + y * y))(d, c)
    return [e - d * e, -(d / c), jnp.maximum(b, c) + jnp.tanh(e)]


def _trivial(z):
    a, _, c = z
    return [c, jnp.asarray(3.0), a + a, a - a]


def _second(z):
    return jax.jvp(_mixed, (list(z),), ([jnp.asarray(x) for x in (0.3, -0.2, 1.1)],))[1]


def _arrays(z):
    """No program of scalars."""
    row = jnp.stack(z)
    return list(jnp.sin(row * row[::-1])[:2])


CASES = {"mixed": _mixed, "trivial": _trivial, "second": _second, "arrays": _arrays}


@pytest.mark.parametrize("name", CASES)
def test_entries_are_those_of_jax(name):
    function, point = CASES[name], [jnp.asarray(x) for x in POINT]
    expected = np.array(jax.jacrev(lambda z: jnp.stack(function(z)))(point)).T
    found = jax.jit(lambda *z: jacobian(function, z))(*point)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)


def test_only_arrays_are_pulled_back(monkeypatch):
    """What has a rule is eliminated: nothing falls back on reverse mode unseen."""
    pulled = []
    transpose = jax.linear_transpose
    monkeypatch.setattr(
        _vertex_elimination.jax, "linear_transpose", lambda *a: pulled.append(a) or transpose(*a)
    )
    point = [jnp.asarray(x) for x in POINT]
    for name in ("mixed", "trivial", "second"):
        jacobian(CASES[name], point)
    assert not pulled
    jacobian(_arrays, point)
    assert len(pulled) == 1


@pytest.mark.slow
def test_the_walker_in_fewer_operations_than_by_reverse_mode():
    """The kept rates in state and parameters: of their derivatives those of a step are made."""
    leaves, structure = jax.tree.flatten(jb.seed_scene())
    numbers = [jnp.asarray(x) for x in (*jb.seed_state(), *leaves)]

    def rates(z):
        scene = jax.tree.unflatten(structure, z[8:])
        return list(jb.dynamics.vector_field(0.0, jb.State(*z[:8]), scene)[4:])

    def by_reverse(*z):
        out, pull = jax.vjp(rates, list(z))
        size = range(len(out))
        rows = [pull([jnp.asarray(1.0 if i == j else 0.0) for j in size])[0] for i in size]
        return jnp.stack([jnp.stack(row) for row in rows])

    def eliminated(*z):
        return jacobian(rates, z)

    found, expected = (np.asarray(jax.jit(f)(*numbers)) for f in (eliminated, by_reverse))
    sizes = np.max(np.abs(expected), axis=1, keepdims=True)
    assert np.max(np.abs(found - expected) / sizes) < 1e-14
    counts = [_operations(f, numbers) for f in (eliminated, by_reverse)]
    assert counts[0] <= min(0.85 * counts[1], 1420)


def _operations(function, numbers):
    """Of the graph that lanes make of it."""
    block = Block()
    shape = jax.ShapeDtypeStruct((), jnp.float64)
    found = lower_function(
        block, function, tuple(numbers), [inputs_of(block, shape) for _ in numbers]
    )
    needed = Liveness([value for array in found for value in array.ravel()])
    return sum(value in needed and value.op != "const" for value in block.values)
