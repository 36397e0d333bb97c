"""Linear algebra of single small matrices; under `vmap` of one after the other.

LAPACK's batched calls share XLA's thread pool on CPUs and wait in it for each other: two at once on
two cores wait for ever (seen with jaxlib 0.10.1).
"""

import jax
import jax.numpy as jnp
from jax.custom_batching import sequential_vmap

from jaxbiped._types import Scalar


@sequential_vmap
def solve(matrix: Scalar, right: Scalar) -> Scalar:
    """The solution of a square system (n, n), right side (n,) or (n, k)."""
    return jnp.linalg.solve(matrix, right)


@sequential_vmap
def invert(matrix: Scalar) -> Scalar:
    """The inverse."""
    return jnp.linalg.inv(matrix)


@sequential_vmap
def eigenpairs(matrix: Scalar) -> tuple[Scalar, Scalar]:
    """Eigenvalues (n,) and right eigenvectors, its columns."""
    values, vectors = jax.lax.linalg.eig(matrix, compute_left_eigenvectors=False)
    return values, vectors


@sequential_vmap
def singular_pairs(matrix: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Left vectors (columns), singular values and right vectors (rows) of (n, k), n at least k."""
    left, values, right = jnp.linalg.svd(matrix, full_matrices=False)
    return left, values, right
