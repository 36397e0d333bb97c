"""Operations of host programs, held against XLA's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import Primitive

from tests.compiler.host_code.host_runs import check_against_xla, written
from tests.compiler.one_shot import evaluate

X = np.array([[0.3, -1.7, 2.5], [0.0, 4.0, -0.25]])
Y = np.array([[2.0, -0.5, 2.5], [1.0, 3.0, -0.25]])
WHOLE = np.array([7, -7, 5, 0])

ENTRYWISE = {
    "arithmetic": lambda x, y: (x + y, x - y, x * y, x / y, -x, abs(x), x * x),
    "extremes": lambda x, y: (jnp.maximum(x, y), jnp.minimum(x, y), jnp.clip(x, -1.0, 1.0)),
    "comparisons": lambda x, y: (x == y, x != y, x < y, x <= y, x > y, x >= y),
    "logic": lambda x, y: ((x > 0) & (y > 0), (x > 0) | (y > 0), (x > 0) ^ (y > 0), ~(x > 0)),
    "elementary": lambda x, y: (jnp.sin(x), jnp.cos(y), jnp.exp(x), jnp.tanh(x), jnp.arctan(x)),
    "roots": lambda x, y: (jnp.sqrt(x * x), jax.lax.rsqrt(1.0 + y * y), jnp.log(1.0 + x * x)),
    "powers": lambda x, y: (x**2, y**3, jax.lax.integer_pow(y, -2), (x * x) ** 1.5),
    "rounding": lambda x, y: (jnp.floor(x), jnp.ceil(x), jnp.round(2.0 * y), jnp.sign(x)),
    "choices": lambda x, y: (jnp.where(x > y, x, y), jnp.where(x > 0.0, 1.0, y)),
    "kinds": lambda x, y: ((x > 0).astype(float), x.astype(int), (x > 0).astype(int), x != 0),
    "numbers": lambda x, y: (jnp.isfinite(x / (y - y)), jnp.isnan(x / (y - y)), x.astype(bool)),
    "bits": lambda x, y: jax.lax.bitcast_convert_type(x, jnp.int64) + 1,
}


@pytest.mark.parametrize("name", ENTRYWISE)
@pytest.mark.parametrize("scalar", [True, False], ids=["scalar", "array"])
def test_entry_by_entry(name, scalar):
    pairs = zip(X.ravel(), Y.ravel(), strict=True) if scalar else [(X, Y)]
    for x, y in pairs:
        check_against_xla(ENTRYWISE[name], x, y)


def test_whole_numbers_divide_towards_zero():
    check_against_xla(lambda a: (jax.lax.div(a, 2), jax.lax.rem(a, 3), a // 2, a % 3), WHOLE)


def test_what_is_no_number_is_told_as_xla_does():
    check_against_xla(lambda x, y: (x / y, jnp.maximum(x / y, 1.0), jnp.sqrt(x)), X[0], 0.0 * X[0])


def test_one_number_stands_for_an_array_of_it():
    """Constants and scalars are spread only where something needs all their entries."""

    def function(x, a):
        wide = jnp.full((2, 3), a)
        chosen = jnp.where(a > 0.0, wide, x), jnp.where(a > 0.0, wide, 0.0)
        return chosen, wide + x, wide, wide.T @ x, jnp.sum(wide, axis=0), wide[0], x * jnp.ones(3)

    check_against_xla(function, X, np.array(2.0))


def test_reductions():
    def function(x):
        sums = jnp.sum(x), jnp.sum(x, axis=1), jnp.prod(x, axis=0), jnp.sum(x[:1], axis=0)
        extremes = jnp.max(x, axis=1), jnp.min(x), jnp.argmax(x, axis=1), jnp.argmin(x)
        return sums, extremes, jnp.all(x > -2.0), jnp.any(x > 3.0, axis=0), jnp.argmax(x[:1], 0)

    check_against_xla(function, X)
    check_against_xla(lambda k: jnp.sum(k.astype(jnp.int32), dtype=jnp.int32), WHOLE)


def test_the_least_of_none_is_infinite():
    none = np.zeros((2, 0))
    check_against_xla(lambda x: jnp.min(x, axis=1, initial=jnp.inf), none)
    check_against_xla(lambda x: jnp.max(x, axis=1, initial=-jnp.inf), none)


def test_sorting_keeps_equal_ones_in_their_order():
    def function(x):
        order = jnp.argsort(x)
        return order, jnp.sort(x), x[order], jnp.argsort(-x, stable=True)

    check_against_xla(function, np.array([3.0, 1.0, 3.0, -2.0, 1.0]))


def test_moves():
    def function(x):
        parts = x[0], x[1, 2], x[:, 1:], x[::-1, ::2], x[None, :, 1], x[0:1, 0:2][0, 1]
        shapes = x.T, x.reshape(6), x.reshape(3, 2), x.ravel()[2:4], jnp.expand_dims(x, 1)
        joined = jnp.concatenate([x, x], axis=1), jnp.stack([x[0], x[1]], axis=1)
        rest = jnp.diag(x[0]), jnp.pad(x, ((1, 0), (0, 2))), jnp.arange(3), jnp.eye(2)
        return parts, shapes, joined, rest, jnp.unstack(x), jnp.split(x, [1], axis=1)

    check_against_xla(function, X)


def test_numbers_in_a_row():
    def function(a, b, x):
        return jnp.stack([a, b, a]), jnp.concatenate([a[None], b[None], x, jnp.zeros(2)])

    check_against_xla(function, np.array(1.5), np.array(-2.0), X[0])


def test_what_has_no_form_is_refused():
    with pytest.raises(NotImplementedError, match="erf"):
        written(jax.lax.erf, [X])


def test_one_text_that_stands_for_different_shapes():
    def function(a, b):
        wide = jnp.broadcast_to(a, (1,)) / jnp.broadcast_to(b, (1,))
        return a / b, jnp.stack([wide, jnp.array([a, b])[:1]], 1)

    check_against_xla(function, 2.0, 3.0)


def test_a_polynomial_has_its_constant_coefficient_first():
    """An operation that newer versions of JAX have, made here; by NumPy and by lanes."""
    polynomial = Primitive("polynomial")
    polynomial.def_abstract_eval(lambda x, *coefficients: x)
    coefficients = (0.5, -2.0, 0.25, 3.0)

    def function(x):
        return polynomial.bind(x, *(jnp.full_like(x, each) for each in coefficients))

    x = np.linspace(-2.0, 2.0, 9)
    expected = 0.5 - 2.0 * x + 0.25 * x**2 + 3.0 * x**3
    np.testing.assert_allclose(written(function, [x])([x]), expected, rtol=1e-14)
    np.testing.assert_allclose(evaluate(function, x), expected, rtol=1e-14)
