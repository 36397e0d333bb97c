"""Small dense matrices, against NumPy's linear algebra."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxbiped.linalg._small_matrices import Eigensystem, eigensystem


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
