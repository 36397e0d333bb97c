"""The unrolled inverse, against a dense solve, whatever entries are left out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.linalg._elimination import factorise, inverse, matmul

BATCH = 50


def _scalars(values, present):
    """Rows of batched scalars, None where an entry is absent."""
    size = present.shape[0]
    return [
        [jnp.asarray(values[:, i, j]) if present[i, j] else None for j in range(size)]
        for i in range(size)
    ]


@jax.jit
def _solution(matrix, right):
    return jnp.stack(matmul(inverse(matrix), right), axis=-1)


def _check(values, present, seed=1):
    values = np.where(present, values, 0.0)
    right = np.random.default_rng(seed).normal(size=values.shape[:2])
    mine = _solution(_scalars(values, present), list(jnp.asarray(right.T)))
    truth = np.linalg.solve(values, right[..., None])[..., 0]
    condition = np.linalg.cond(values)[:, None]
    assert (np.abs(mine - truth) < 1e-14 * condition * np.abs(truth).max(-1, keepdims=True)).all()
    well = condition[:, 0] < 50.0
    assert np.abs(mine - truth)[well].max() < 1e-12
    assert well.any()


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_random_matrices(size):
    values = np.random.default_rng(size).normal(size=(BATCH, size, size))
    _check(values, np.ones((size, size), dtype=bool))


def test_pivots_are_searched_in_every_lane():
    """Tiny leading entries ruin an elimination that does not exchange rows."""
    values = np.random.default_rng(7).normal(size=(BATCH, 4, 4))
    values[::2, 0, 0] *= 1e-17
    values[1::3, 1, 1] = 0.0
    values[::5, 0, 0] = 0.0
    _check(values, np.ones((4, 4), dtype=bool))


@pytest.mark.parametrize("seed", range(6))
def test_entries_left_out(seed):
    rng = np.random.default_rng(seed)
    present = rng.random((5, 5)) < 0.35
    present[np.arange(5), rng.permutation(5)] = True
    values = rng.normal(size=(BATCH, 5, 5)) + 0.2
    _check(values, present)


def test_a_permutation():
    """Only one entry can be each column's pivot."""
    present = np.eye(4, dtype=bool)[np.array([2, 0, 3, 1])]
    _check(np.random.default_rng(3).normal(size=(BATCH, 4, 4)), present)


def test_singular_by_value_is_not_finite():
    ones = [[jnp.asarray(1.0)] * 2] * 2
    assert not np.isfinite(matmul(inverse(ones), [jnp.asarray(1.0), jnp.asarray(2.0)])).any()


def test_derivative_of_a_solution():
    """d(A⁻¹ b) = −A⁻¹ dA A⁻¹ b."""
    rng = np.random.default_rng(5)
    A, dA, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)

    def mine(a):
        return jnp.stack(matmul(inverse([list(row) for row in a]), list(jnp.asarray(b))))

    _, tangent = jax.jvp(mine, (jnp.asarray(A),), (jnp.asarray(dA),))
    truth = -np.linalg.solve(A, dA @ np.linalg.solve(A, b))
    np.testing.assert_allclose(tangent, truth, rtol=1e-11)


@pytest.mark.parametrize(("size", "count"), [(1, 3), (2, 3), (4, 3), (5, 1)])
def test_by_blocks(size, count):
    """Blocks on the diagonal that have inverses; rows of each take turns as pivots."""
    rng = np.random.default_rng(size)
    n = size * count
    for _ in range(20):
        matrix = 0.2 * rng.normal(size=(n, n))
        for k in range(0, n, size):
            # Exchanged rows: without pivots inside of blocks there are zeros to divide by.
            matrix[k : k + size, k : k + size] += np.eye(size)[::-1] * 2.0
            matrix[k, k] *= 0.0 if size > 1 else 1.0
        right = rng.normal(size=n)
        blocks = matrix.reshape(count, size, count, size)
        factors = factorise(jnp.asarray(np.transpose(blocks, (3, 0, 2, 1))))
        for found, whole in (
            (factors.solve(jnp.asarray(right)), matrix),
            (factors.solve_transposed(jnp.asarray(right)), matrix.T),
        ):
            np.testing.assert_allclose(found, np.linalg.solve(whole, right), rtol=1e-11, atol=1e-12)
