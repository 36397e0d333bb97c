"""Primitives of whole numbers, truth values and small arrays in lanes, against NumPy's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped import ArgumentError
from tests.compiler.one_shot import compiled, evaluate

A = np.array([-7.6, -2.0, -0.4, 0.0, 0.4, 3.0, 5.5])
B = np.array([2.3, -2.0, 1.5, 0.0, -3.5, 3.0, -5.5])


def wholes(lib, kind, a, b):
    a, b = a.astype(kind), b.astype(kind)
    zero = a - a
    found = [
        a + b, a - b, a * b, -a, abs(a), a & b, a | b, a ^ b, ~a,
        lib.maximum(a, b), lib.minimum(a, b), lib.maximum(a, zero),
        lib.clip(a, zero - 2, zero + 3), a**3,
    ]  # fmt: skip
    compared = [a == b, a != b, a < b, a <= b, a > b, a >= b, a.astype(bool), b.astype(bool)]
    return [each.astype(float) for each in (*found, *compared)]


def truths(lib, a, b):
    p, q = a > 0.0, b > 0.0
    found = [
        p & q, p | q, p ^ q, ~p, p == q, p != q, lib.maximum(p, q), lib.minimum(p, q),
        lib.where(p, q, ~q), lib.isfinite(a / lib.where(p, 1.0, 0.0)),
    ]  # fmt: skip
    converted = [p.astype(int), p.astype("int32") + q.astype("int32"), a.astype(bool)]
    return [each.astype(float) for each in (*found, *converted)]


def singles(lib, a, b):
    a, b = a.astype("float32"), b.astype("float32")
    found = [a + b, a * b - a, lib.maximum(a, b), lib.where(a > b, a, -b), lib.sqrt(abs(a)), a**2]
    kinds = [a.astype("int32"), a.astype("int64").astype("int32").astype("int64"), a.astype(bool)]
    return [each.astype(float) for each in (*found, *kinds)]


def floats(lib, a, b):
    size = abs(a) + 0.5
    return [
        lib.sign(a), lib.floor(a), lib.ceil(a), lib.round(a), lib.maximum(a, 0.0),
        lib.minimum(a, 0.0), lib.maximum(a, 2.0), lib.minimum(a, b), lib.maximum(2.0, a),
        lib.maximum(a, b), lib.clip(a, -1.0, 2.0), lib.log2(size), lib.square(a), a**0, a**1,
        a**5, size**-3, a / size, 2.0 / size, a / 3.0, b / size + a / size,
        (a > 0.0).astype(float) * b, lib.exp(1.5 * lib.log(size)), lib.exp(b * lib.log(size)),
    ]  # fmt: skip


TABLES = {
    "int64": lambda lib, a, b: wholes(lib, "int64", a, b),
    "int32": lambda lib, a, b: wholes(lib, "int32", a, b),
    "truths": truths,
    "singles": singles,
    "floats": floats,
}


@pytest.mark.parametrize("name", TABLES)
def test_entry_by_entry_as_numpy_does(name):
    found = evaluate(lambda a, b: jnp.stack(TABLES[name](jnp, a, b)), A, B)
    with np.errstate(all="ignore"):
        expected = np.stack(TABLES[name](np, A, B), axis=1)
    rounding = 2e-7 if name == "singles" else 1e-14  # a sum with a product is rounded once
    np.testing.assert_allclose(found, expected, rtol=rounding, atol=rounding)


def test_the_larger_of_a_number_and_none_is_none():
    a, b = np.array([np.nan, 1.0, np.nan, 2.0]), np.array([1.0, np.nan, np.nan, 3.0])

    def function(a, b):
        return jnp.stack([
            jnp.maximum(a, b), jnp.minimum(a, b), jnp.maximum(a, 0.0), jnp.minimum(0.0, a),
            jnp.maximum(a, 5.0), jnp.minimum(5.0, a), jnp.clip(a, -1.0, 1.0), jnp.sign(a),
        ])  # fmt: skip

    nan = np.nan
    expected = [
        [nan, nan, nan, 3.0], [nan, nan, nan, 2.0], [nan, 1.0, nan, 2.0], [nan, 0.0, nan, 0.0],
        [nan, 5.0, nan, 5.0], [nan, 1.0, nan, 2.0], [nan, 1.0, nan, 1.0], [nan, 1.0, nan, 1.0],
    ]  # fmt: skip
    np.testing.assert_array_equal(evaluate(function, a, b), np.transpose(expected))


X = np.random.default_rng(9).normal(size=(2, 3, 4))
MOVES = {
    "part": lambda lib, x: x[:, 1:, ::2],
    "backwards": lambda lib, x: x[::-1, :, ::-1],
    "transposed": lambda lib, x: lib.transpose(x, (2, 0, 1)),
    "in other shapes": lambda lib, x: x.reshape(4, 6)[:, None, 2:].squeeze(1),
    "side by side": lambda lib, x: lib.concatenate([x[:, :1], x, x[:, 2:] * 2.0], axis=1),
    "stacked": lambda lib, x: lib.stack([x[..., 0], x[..., 3]], axis=1),
    "split": lambda lib, x: lib.split(x, [1, 3], axis=2)[1] - lib.split(x, [1, 3], axis=2)[0],
    "wide": lambda lib, x: lib.broadcast_to(x[:, :1, :], (2, 3, 4)) + x[0, 0, 0],
    "by place": lambda lib, x: x * lib.arange(4.0) + lib.arange(3.0)[:, None],
    "sums": lambda lib, x: lib.sum(x, axis=(0, 2)),
    "products": lambda lib, x: lib.prod(x, axis=1),
    "largest": lambda lib, x: lib.max(x, axis=0) - lib.min(x, axis=(0, 1)),
    "all and any": lambda lib, x: (
        lib.all(x > -1.0, axis=0).astype(float) + 2.0 * lib.any(x > 1.0, axis=0).astype(float)
    ),
    "matrices": lambda lib, x: lib.einsum("aij,akj->aik", x, x),
    "two axes": lambda lib, x: lib.einsum("aij,bij->ab", x, x),
    "outer": lambda lib, x: lib.einsum("ai,bj->abij", x[..., 0], x[:, 0]),
    "vector": lambda lib, x: x[0] @ x[1, 2],
}


def test_small_arrays_as_numpy_does():
    def function(x):
        return jnp.concatenate([jnp.ravel(MOVES[name](jnp, x)) for name in MOVES])

    found = evaluate(function, np.stack([X, X**2]))
    for own, x in zip(found, (X, X**2), strict=True):
        expected = np.concatenate([np.ravel(MOVES[name](np, x)) for name in MOVES])
        np.testing.assert_allclose(own, expected, rtol=1e-13, atol=1e-14)


def test_room_between_before_and_behind_entries():
    def function(x):
        rows = jax.lax.pad(x, 7.0, [(1, 0, 2), (-1, 2, 0)])
        return jnp.concatenate([rows.ravel(), jax.lax.pad(x[0], 0.5, [(0, -2, 1)])])

    whole = np.full((2, 5, 4), 7.0)
    x = np.arange(12.0).reshape(2, 2, 3)
    whole[:, 1::3, :2] = x[:, :, 1:]
    ends = np.stack([x[:, 0, 0], np.full(2, 0.5), x[:, 0, 1]], axis=1)
    expected = np.concatenate([whole.reshape(2, -1), ends], axis=1)
    np.testing.assert_array_equal(evaluate(function, x), expected)


@pytest.mark.parametrize(
    "function",
    [
        lambda x: jnp.sign(x.astype(int)).astype(float),
        lambda x: jax.lax.div(x.astype(int), 3).astype(float),
        lambda x: jax.lax.round(x, jax.lax.RoundingMethod.AWAY_FROM_ZERO),
    ],
)
def test_what_lanes_do_not_do_is_left_to_xla(function):
    with pytest.raises(ArgumentError, match=r"engine=\"xla\""):
        compiled(function, ()).check()
