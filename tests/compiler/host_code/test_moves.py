"""Moves of entries in host programs, one behind the other, against NumPy's own."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.compiler.host_code._arrays import (
    divide_whole,
    dynamic_slice,
    eigensystem_of,
    factors_of,
    power_of,
    replaced,
    singular_system_of,
    sorted_by,
    triangular,
)
from jaxbiped.compiler.host_code._host_jit import write_host_program
from jaxbiped.compiler.host_code._moves import _colon, _within

X = np.random.default_rng(4).normal(size=(4, 4))
MOVES = {
    "behind": lambda lib, x: x[1:],
    "but the last": lambda lib, x: x[:, :-1],
    "inner": lambda lib, x: x[1:3, 1:],
    "every other": lambda lib, x: x[::2],
    "first row": lambda lib, x: x[0][None],
    "last column": lambda lib, x: x[:, -1:],
    "backwards": lambda lib, x: x[:, ::-1],
    "transposed": lambda lib, x: x.T,
    "in another shape": lambda lib, x: x.reshape(x.shape[::-1]),
    "in a row": lambda lib, x: x.reshape(1, -1),
    "doubled": lambda lib, x: lib.concatenate([x, x[:1]], axis=0),
    "stacked": lambda lib, x: lib.stack([x[0], x[-1]], axis=1),
    "wide": lambda lib, x: lib.broadcast_to(x[:, :1], x.shape),
    "of one number": lambda lib, x: lib.full_like(x, 1.0) * x[0, 0],
    "some more": lambda lib, x: lib.concatenate([x[:, 0], lib.ones(1)])[None],
    "columns apart": lambda lib, x: lib.concatenate(lib.split(x, [1], axis=1)[::-1], axis=1),
}


def all_moved(lib, x):
    """One number at least is left by any two."""
    pairs = itertools.product(MOVES.values(), repeat=2)
    return [second(lib, first(lib, x)) for first, second in pairs]


def test_any_two_moves_one_behind_the_other():
    found = write_host_program(lambda leaves: all_moved(jnp, *leaves), [X])([X])
    names = itertools.product(MOVES, repeat=2)
    for own, expected, name in zip(found, all_moved(np, X), names, strict=True):
        np.testing.assert_array_equal(own, expected, err_msg=str(name))
        assert np.shape(own) == expected.shape, name


def test_nothing_behind_nothing_is_nothing():
    def joined(leaves):
        (x,) = leaves
        empty = jax.lax.slice_in_dim(x, 0, 0)
        return jax.lax.concatenate([empty, empty], 0)

    found = write_host_program(joined, [X])([X])
    assert (found.shape, found.dtype) == ((0, X.shape[1]), X.dtype)


@pytest.mark.parametrize("starts", [(1, 2), (-3, 3), (9, -1)])
def test_a_window_is_moved_inwards_whether_its_place_is_known_or_not(starts):
    inside = [min(max(start, 0), 4 - size) for start, size in zip(starts, (2, 3), strict=True)]
    expected = X[inside[0] : inside[0] + 2, inside[1] : inside[1] + 3]
    np.testing.assert_array_equal(dynamic_slice(X, (2, 3), *starts), expected)

    def known(leaves):
        return jax.lax.dynamic_slice(*leaves, np.maximum(starts, 0), (2, 3))  # JAX's wrap around

    np.testing.assert_array_equal(write_host_program(known, [X])([X]), expected)


def test_a_part_of_a_part_is_one_part():
    numbers = np.arange(12)
    for outer in (slice(None), slice(2, 9), slice(3, None)):
        for inner in (0, 3, slice(None), slice(1, 4), slice(2, None), slice(1, None, 2)):
            part = _within(outer, inner)
            np.testing.assert_array_equal(numbers[part], numbers[outer][inner])
            if isinstance(part, slice):
                np.testing.assert_array_equal(eval(f"numbers[{_colon(part)}]"), numbers[part])
    assert _colon(slice(None, None, -1)) == "::-1"
    assert _colon(slice(2, 5, 1)) == "2:5"


def test_whole_numbers_are_divided_towards_zero_and_by_zero_are_minus_one():
    a, b = (each.ravel() for each in np.meshgrid([-7, -6, 0, 5, 9], [-3, -1, 1, 4]))
    np.testing.assert_array_equal(divide_whole(a, b), np.trunc(a / b))
    assert divide_whole(a, b).dtype == a.dtype
    np.testing.assert_array_equal(divide_whole(np.array([3, -3, 0]), 0), -1)
    assert divide_whole(np.int64(-9), 2) == -4


def test_whole_powers_and_entries_replaced():
    for power in range(-3, 6):
        np.testing.assert_allclose(power_of(X, power), X ** float(power))
    for place in ((0, 3), (3, 0)):
        whole = replaced(X, place, 9.0)
        assert whole[place] == 9.0
        assert np.sum(whole != X) == 1
    for place in ((0, 4), (-1, 0), (4, 4)):
        np.testing.assert_array_equal(replaced(X, place, 9.0), X)


@pytest.mark.parametrize("axis", [0, 1])
def test_arrays_are_sorted_by_the_first_and_then_the_second(axis):
    first = np.array([[1, 0, 1, 0], [1, 1, 0, 0], [0, 1, 0, 1]])
    second, third = np.arange(12).reshape(3, 4)[::-1] % 5, np.arange(12).reshape(3, 4)
    found = sorted_by([first, second, third], axis, 2)
    by_one = sorted_by([first, second], axis, 1)
    for k in range(first.shape[1 - axis]):
        rows = [np.take(each, k, axis=1 - axis) for each in (first, second, third)]
        expected = sorted(zip(*map(list, rows), strict=True))
        got = [np.take(each, k, axis=1 - axis).tolist() for each in found]
        assert list(zip(*got, strict=True)) == expected
        stable = sorted(range(len(rows[0])), key=lambda i, key=rows[0]: key[i])
        assert np.take(by_one[1], k, axis=1 - axis).tolist() == rows[1][stable].tolist()


def test_factors_are_those_of_the_rows_permuted():
    factors, pivots, rows = factors_of(X)
    lower, upper = np.tril(factors, -1) + np.eye(4), np.triu(factors)
    np.testing.assert_allclose(lower @ upper, X[rows])
    assert (pivots.dtype, rows.dtype) == (np.int32, np.int32)
    assert np.max(np.abs(np.tril(factors, -1))) <= 1.0
    order = list(range(4))
    for i, j in enumerate(pivots):
        order[i], order[j] = order[j], order[i]
    assert order == rows.tolist()


@pytest.mark.parametrize("lower", [True, False])
@pytest.mark.parametrize("transposed", [True, False])
@pytest.mark.parametrize("unit", [True, False])
def test_triangular_systems(lower, transposed, unit):
    a, b = X + 3.0 * np.eye(4), np.random.default_rng(5).normal(size=(4, 2))
    part = np.tril(a) if lower else np.triu(a)
    if unit:
        np.fill_diagonal(part, 1.0)
    whole = part.T if transposed else part
    how = dict(lower=lower, transposed=transposed, unit=unit)
    np.testing.assert_allclose(whole @ triangular(a, b, left=True, **how), b, atol=1e-13)
    np.testing.assert_allclose(triangular(a, b.T, left=False, **how) @ whole, b.T, atol=1e-13)


def test_eigenvectors_of_pairs_are_conjugate():
    matrix = np.array([[0.5, -2.0, 0.0], [1.0, 0.5, 0.3], [0.2, 0.0, -1.0]])
    values, left, right = eigensystem_of(matrix, left=True, right=True)
    assert np.sum(values.imag > 0.0) == 1
    np.testing.assert_allclose(matrix @ right, right * values, atol=1e-14)
    np.testing.assert_allclose(left.conj().T @ matrix, values[:, None] * left.conj().T, atol=1e-14)
    assert len(eigensystem_of(matrix, left=False, right=False)) == 1
    (_, only) = eigensystem_of(matrix, left=False, right=True)
    np.testing.assert_array_equal(only, right)
    (_, only) = eigensystem_of(matrix, left=True, right=False)
    np.testing.assert_array_equal(only, left)


def test_singular_values_of_what_is_no_number_are_none_of_the_others():
    matrices = np.stack([X[:, :3], X[:, 1:], X[:, :3] ** 2])
    matrices[1, 2, 0] = np.inf
    for full in (False, True):
        values, left, right = singular_system_of(matrices, full=full, vectors=True)
        for k in (0, 2):
            rebuilt = left[k][:, :3] * values[k] @ right[k][:3]
            np.testing.assert_allclose(rebuilt, matrices[k], atol=1e-14)
        assert all(np.all(np.isnan(each[1])) for each in (values, left, right))
        assert left.shape == (3, 4, 4 if full else 3)
    (only,) = singular_system_of(matrices, full=False, vectors=False)
    np.testing.assert_allclose(only, values, atol=1e-14)
