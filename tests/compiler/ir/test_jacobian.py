"""Jacobians by elimination, against those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler import jacobian, partial_derivatives
from jaxbiped.compiler.ir import _lower_jaxpr
from jaxbiped.compiler.ir._graph import Block
from jaxbiped.compiler.ir._liveness import Liveness
from jaxbiped.compiler.runtime._program import inputs_of, lower_function
from tests.compiler.one_shot import evaluate

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


def _by_xla(function, point):
    return jax.jit(lambda *z: jacobian(function, z))(*point)


def _by_lanes(function, point):
    return evaluate(lambda *z: jacobian(function, z), *(x[None] for x in point))[0]


def _by_entries(function, point):
    """Before any compiler sees it, as implicit steps take it; what is zero is left out."""
    found = partial_derivatives(function, point)
    rows = range(len(function(point)))
    return [[found.get((i, j), 0.0) for j in range(len(point))] for i in rows]


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("how", [_by_xla, _by_lanes, _by_entries])
def test_entries_are_those_of_jax(name, how):
    function, point = CASES[name], [jnp.asarray(x) for x in POINT]
    expected = np.array(jax.jacrev(lambda z: jnp.stack(function(z)))(point)).T
    np.testing.assert_allclose(how(function, point), expected, rtol=1e-13, atol=1e-15)


def test_it_is_mapped_and_differentiated_as_other_functions_are():
    def entry(x):
        return jacobian(_mixed, [x, 2.0 * x, jnp.asarray(POINT[2])])[0, 1]

    def expected(x):
        return jax.grad(lambda y: _mixed([x, y, POINT[2]])[0])(2.0 * x)

    points = jnp.array([0.4, 0.7])
    for ours, own in ((entry, expected), (jax.grad(entry), jax.grad(expected))):
        found = jax.vmap(ours)(points)
        np.testing.assert_allclose(found, [own(x) for x in points], rtol=1e-12)


def test_a_jacobian_may_hold_what_the_function_around_it_has():
    def scaled(x):
        return jax.jit(lambda y: jacobian(lambda z: [x * z[0] * z[0]], [y])[0, 0])(x + 1.0)

    assert float(jax.jit(scaled)(2.0)) == 12.0
    assert evaluate(scaled, [2.0])[0] == 12.0


def test_only_arrays_are_pulled_back(monkeypatch):
    """What has a rule is eliminated: nothing falls back on reverse mode unseen."""
    pulled, whole = [], _lower_jaxpr.pulled_back
    monkeypatch.setattr(
        _lower_jaxpr, "pulled_back", lambda *a, **how: pulled.append(a) or whole(*a, **how)
    )
    point = [jnp.asarray(x) for x in POINT]
    for name in ("mixed", "trivial", "second"):
        _by_lanes(CASES[name], point)
    assert not pulled
    _by_lanes(_arrays, point)
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

    found = evaluate(eliminated, *(x[None] for x in numbers))[0]
    expected = np.asarray(jax.jit(by_reverse)(*numbers))
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
