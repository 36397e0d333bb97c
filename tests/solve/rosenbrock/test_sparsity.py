"""Structure read off a program, against its Jacobian: no dependence is missed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.solve.rosenbrock._linearisation import structure_of


def _structure(function, inputs):
    return structure_of(jax.make_jaxpr(function)(*[jnp.asarray(1.5)] * inputs))


def test_dependences_and_copies():
    def function(a, b, c, d):
        return b, a * c, jnp.asarray(2.0), 3.0 * d, a, jnp.sin(b) + d

    depends, copies = _structure(function, 4)
    assert depends == tuple(map(frozenset, [{1}, {0, 2}, set(), {3}, {0}, {1, 3}]))
    assert copies == (1, None, None, None, 0, None)


def test_calls_are_looked_into():
    inner = jax.jit(lambda a, b: (b, a * a))

    @jax.custom_jvp
    def custom(a, b):
        return a * 2.0, b

    custom.defjvp(lambda primals, tangents: (custom(*primals), tangents))

    def function(a, b, c):
        first, second = inner(a, b)
        third, fourth = custom(b, c)
        fifth, sixth = jax.checkpoint(lambda x, y: (y, jnp.cos(x)))(a, c)
        return first, second, third, fourth, fifth, sixth

    depends, copies = _structure(function, 3)
    assert depends == tuple(map(frozenset, [{1}, {0}, {1}, {2}, {2}, {0}]))
    assert copies == (1, None, None, 2, 2, None)


@pytest.mark.parametrize(
    "function",
    [
        lambda a, b, c: jax.lax.cond(a > 0.0, lambda: b, lambda: c),
        lambda a, b, c: jnp.where(a > 0.0, b, c),
        lambda a, b, c: jax.lax.while_loop(lambda x: x < a, lambda x: x + b, c),
        lambda a, b, c: jax.lax.fori_loop(0, 3, lambda _, x: x * a + b, c),
        lambda a, b, c: jax.lax.scan(lambda x, _: (x * a + b, None), c, None, length=2)[0],
        lambda a, b, c: jnp.stack([a, b, c])[1] + 0.0,
    ],
)
def test_what_is_not_understood_depends_on_everything(function):
    depends, copies = _structure(lambda a, b, c: (function(a, b, c), b), 3)
    assert depends == (frozenset({0, 1, 2}), frozenset({1}))
    assert copies == (None, 1)


def test_never_misses_an_entry_of_the_jacobian():
    def function(*x):
        a, b, c, d = x
        e = jnp.where(a > b, a * c, d)
        return e, jnp.hypot(b, d), jnp.floor(c), a - a, jax.jit(jnp.arctan2)(e, b)

    depends, _ = _structure(function, 4)
    x = [jnp.asarray(value) for value in np.random.default_rng(0).normal(size=4)]
    jacobian = jax.jacfwd(lambda x: function(*x))(x)
    for used, row in zip(depends, jacobian, strict=True):
        assert {j for j, entry in enumerate(row) if entry != 0.0} <= used
