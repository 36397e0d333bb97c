"""Small dense matrices, against NumPy's linear algebra, whatever entries are left out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.linalg._small_matrices import (
    Eigensystem,
    eigensystem,
    factorise,
    inverse,
    singular_pairs,
    solution,
    symmetric_factors,
)

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
    return jnp.einsum("ij...,j...->...i", jnp.array(inverse(matrix)), jnp.stack(right))


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
    assert not np.isfinite(_solution(ones, [jnp.asarray(1.0), jnp.asarray(2.0)])).any()


def test_derivative_of_a_solution():
    """d(A⁻¹ b) = −A⁻¹ dA A⁻¹ b."""
    rng = np.random.default_rng(5)
    A, dA, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)

    def mine(a):
        return _solution([list(row) for row in a], list(jnp.asarray(b)))

    _, tangent = jax.jvp(mine, (jnp.asarray(A),), (jnp.asarray(dA),))
    truth = -np.linalg.solve(A, dA @ np.linalg.solve(A, b))
    np.testing.assert_allclose(tangent, truth, rtol=1e-11)


@jax.jit
def _block_solutions(columns, right):
    factors = factorise(columns)
    return factors.solve(right), factors.solve_transposed(right)


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
        both = _block_solutions(np.transpose(blocks, (3, 0, 2, 1)), right)
        for found, whole in zip(both, (matrix, matrix.T), strict=True):
            np.testing.assert_allclose(found, np.linalg.solve(whole, right), rtol=1e-11, atol=1e-12)


def _with_double_zero(coupling):
    """Eigenvalues 0.5, −0.2 and two zeros, which have a single eigenvector where there is coupling;
    in coordinates in which no entry is zero."""
    jordan = np.diag([0.5, -0.2, 0.0, 0.0])
    jordan[2, 3] = coupling
    basis = np.random.default_rng(3).normal(size=(4, 4))
    return basis @ jordan @ np.linalg.inv(basis)


def test_left_vectors_of_simple_eigenvalues_beside_a_zero_of_one_vector():
    """A section's and a push's zeros may have one eigenvector: others' left vectors do not know."""
    shear = np.array([[0.5, 1.0, 2.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    for matrix in (shear, *map(_with_double_zero, (0.0, 1e-9, 1.0))):
        found = Eigensystem(*map(np.asarray, eigensystem(jnp.asarray(matrix))))
        place = int(np.argmax(np.abs(found.values)))
        left, right = found.left[place], found.right[:, place]
        np.testing.assert_allclose(found.values[place], 0.5, rtol=1e-12)
        np.testing.assert_allclose(left @ matrix, 0.5 * left, rtol=0, atol=1e-12)
        np.testing.assert_allclose(left @ right, 1.0, rtol=1e-12)


def test_pairs_of_conjugates_under_vmap():
    matrices = np.random.default_rng(1).normal(size=(5, 4, 4))
    found = Eigensystem(*map(np.asarray, jax.vmap(eigensystem)(jnp.asarray(matrices))))
    ones = np.broadcast_to(np.eye(4), (5, 4, 4))
    np.testing.assert_allclose(found.left @ found.right, ones, atol=1e-10)
    rebuilt = (found.right * found.values[:, None]) @ found.left
    np.testing.assert_allclose(rebuilt, matrices, atol=1e-10)


@pytest.mark.parametrize("size", [1, 4])
def test_a_solution_on_whole_arrays(size):
    rng = np.random.default_rng(size)
    dense = rng.normal(size=(size, size))
    for matrix in (dense, np.roll(np.diag(np.diag(dense)), 1, axis=0)):
        right = rng.normal(size=size)
        found = jax.jit(solution)(jnp.asarray(matrix), jnp.asarray(right))
        np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-11)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_a_symmetric_system(size):
    """Only its lower half is read; L D Lᵀ is the matrix."""
    rng = np.random.default_rng(size)
    half, right = rng.normal(size=(size, size)), rng.normal(size=size)
    matrix = half @ half.T + np.eye(size)
    factors = symmetric_factors([list(row) for row in jnp.asarray(np.tril(matrix))])
    lower = np.eye(size)
    for i, row in enumerate(factors.lower):
        lower[i, :i] = row
    np.testing.assert_allclose((lower / np.array(factors.inverse)) @ lower.T, matrix, rtol=1e-12)
    found = factors.solve(list(jnp.asarray(right)))
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-11)


def test_what_hardly_differs_from_other_rows_of_a_symmetric_system_is_left_out():
    """The third row repeats the first, but for less than the share; then but for more."""
    matrix = np.array([[2.0, 0.5, 2.0], [0.5, 1.0, 0.5], [2.0, 0.5, 2.0]])
    right = np.array([1.0, -0.4, 1.0])
    for apart, kept in ((0.0, False), (1e-9, False), (1e-7, True)):
        matrix[2, 2] = 2.0 + apart
        factors = symmetric_factors([list(row) for row in jnp.asarray(matrix)], 1e-8)
        found = np.array(factors.solve(list(jnp.asarray(right + np.array([0.0, 0.0, apart])))))
        assert (found[2] != 0.0) == kept
        # What the third row says beyond the first is that its own unknown is 1.
        others = np.linalg.solve(matrix[:2, :2], right[:2] - kept * matrix[:2, 2])
        np.testing.assert_allclose(found, [*others, float(kept)], rtol=1e-6)


def test_singular_pairs_of_tall_matrices_under_vmap():
    matrices = np.random.default_rng(2).normal(size=(3, 4, 2))
    left, values, right = map(np.asarray, jax.vmap(singular_pairs)(jnp.asarray(matrices)))
    assert left.shape == (3, 4, 2)
    np.testing.assert_allclose((left * values[:, None]) @ right, matrices, atol=1e-13)
    expected = np.linalg.svd(matrices, compute_uv=False)
    np.testing.assert_allclose(values, expected, rtol=1e-12)
