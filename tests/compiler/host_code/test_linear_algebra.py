"""Products and LAPACK in host programs, held against XLA's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.custom_batching import sequential_vmap

from tests.compiler.host_code.host_runs import check_against_xla

solve = sequential_vmap(jnp.linalg.solve)


@sequential_vmap
def eigensystem(matrix):
    """Eigenvalues, right vectors (columns) and left ones (rows), wᵀ v = 1 in pairs."""
    values, left, right = jax.lax.linalg.eig(matrix)
    left = jnp.conj(left)
    return values, right, (left / jnp.sum(left * right, axis=0)).T


def eigenpairs(matrix):
    return jax.lax.linalg.eig(matrix, compute_left_eigenvectors=False)


GENERATOR = np.random.default_rng(3)
A, B, C = (GENERATOR.normal(size=shape) for shape in ((5, 5), (5, 3), (4, 5, 5)))


def test_products():
    def function(a, b, c):
        plain = a @ b, b.T @ a, a @ b[:, 0], b[:, 0] @ a, b[:, 0] @ b[:, 1]
        return plain, c @ a, jax.vmap(jnp.dot)(c, c), jax.vmap(lambda m: m @ b[:, 0])(c)

    check_against_xla(function, A, B, C, rtol=1e-12)


def test_products_over_any_number_of_axes():
    """As a cycle of several arrivals makes them: in a batch, over two axes or over none."""

    def function(a, c):
        many = jnp.einsum("kij,kjab->kiab", c, jnp.stack([c] * 5, axis=1))
        batched = many, jnp.einsum("kij,kl->kjil", c, c[..., 0])
        return (
            batched,
            jnp.tensordot(c, c, ((1, 2), (2, 1))),
            jnp.tensordot(c, a, 0),
            jnp.tensordot(c, c, (2, 1)),
        )

    check_against_xla(function, A, C, rtol=1e-12)


def test_products_of_batches_along_different_axes():
    """Of one batch, then of two that lie the other way round in the second factor."""

    def function(c):
        behind = jnp.moveaxis(c, 0, 1)
        once = jax.lax.dot_general(c, behind, (((2,), (0,)), ((0,), (1,))))
        return once, jax.lax.dot_general(c, behind, (((2,), (2,)), ((0, 1), (1, 0))))

    check_against_xla(function, C, rtol=1e-12)


@pytest.mark.parametrize("rows", [1, 3])
def test_systems(rows):
    def function(a, b):
        return solve(a, b[:, :rows]), solve(a.T, b[:, 0]), jax.vmap(solve, (None, 1))(a, b)

    check_against_xla(function, A, B, rtol=1e-12)


def test_a_singular_system_has_no_finite_solution():
    singular = np.ones((3, 3))
    found = check_against_xla(solve, singular, np.array([1.0, 2.0, 3.0]))
    assert not np.all(np.isfinite(found[0]))


def test_triangles():
    def function(a, b):
        how = dict(left_side=True, lower=True)
        solved = jax.lax.linalg.triangular_solve
        ways = [dict(transpose_a=t, unit_diagonal=u) for t in (True, False) for u in (True, False)]
        return [solved(a, b, **how, **way) for way in ways], solved(a, b.T, left_side=False)

    check_against_xla(function, A + 4.0 * np.eye(5), B, rtol=1e-12)


def test_singular_systems():
    """By products, for signs are free; a matrix that is no number leaves others as they are."""

    def function(b, c):
        left, values, right = jnp.linalg.svd(b, full_matrices=False)
        own, several, others = jax.vmap(jnp.linalg.svd)(c)
        products = left * values @ right, jnp.einsum("kij,kj,kjl->kil", own, several, others)
        return products, values, several, jnp.linalg.svd(b, compute_uv=False)

    check_against_xla(function, B, C, rtol=1e-11)
    check_against_xla(function, B, C * np.array([1.0, np.nan, 1.0, 1.0])[:, None, None], rtol=1e-11)


def test_eigensystems():
    """Real and complex pairs, of one matrix and of several one after the other."""
    pairs = np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.5]])
    check_against_xla(lambda m: (eigensystem(m), eigenpairs(m)), pairs, rtol=1e-12)
    check_against_xla(jax.vmap(eigensystem), C, rtol=1e-11)
