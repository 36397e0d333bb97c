"""Linear algebra of single small matrices; under `vmap` of one after the other.

LAPACK's batched calls share XLA's thread pool on CPUs and wait in it for each other: two at once on
two cores wait for ever (seen with jaxlib 0.10.1).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_batching import sequential_vmap

from jaxbiped._types import Scalar


@sequential_vmap
def solve(matrix: Scalar, right: Scalar) -> Scalar:
    """The solution of a square system (n, n), right side (n,) or (n, k)."""
    return jnp.linalg.solve(matrix, right)


@sequential_vmap
def eigenpairs(matrix: Scalar) -> tuple[Scalar, Scalar]:
    """Eigenvalues (n,) and right eigenvectors, its columns."""
    values, vectors = jax.lax.linalg.eig(matrix, compute_left_eigenvectors=False)
    return values, vectors


class Eigensystem(NamedTuple):
    """Eigenvalues (n,), right eigenvectors (columns) and left ones (rows), wᵀ v = 1 in pairs.

    A left one is infinite or huge where its eigenvalue has fewer eigenvectors than it has places.
    """

    values: Scalar
    right: Scalar
    left: Scalar


@sequential_vmap
def eigensystem(matrix: Scalar) -> Eigensystem:
    """Eigenvalues with eigenvectors of both sides.

    Each pair is found by itself: the inverse of all right vectors would carry the parallel ones of
    a multiple eigenvalue (the zeros of a section and of a push) into the rows of all others.
    """
    values, left, right = jax.lax.linalg.eig(matrix)
    left = jnp.conj(left)
    return Eigensystem(values, right, (left / jnp.sum(left * right, axis=0)).T)


@sequential_vmap
def singular_pairs(matrix: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Left vectors (columns), singular values and right vectors (rows) of (n, k), n at least k."""
    left, values, right = jnp.linalg.svd(matrix, full_matrices=False)
    return left, values, right
