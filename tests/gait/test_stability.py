"""Multipliers and bifurcations, against monodromy matrices that are known beforehand."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from jaxbiped.gait import Bifurcation, stability_of

ROTATION = [[0.6, -0.8], [0.8, 0.6]]


def _stability(*blocks, error=0.0):
    """Of 1 along the velocity and these blocks, seen in a skew basis."""
    diagonal = scipy.linalg.block_diag(1.0, *blocks)
    basis = np.eye(len(diagonal)) + 0.3 * np.random.default_rng(0).normal(size=diagonal.shape)
    matrix = basis @ diagonal @ np.linalg.inv(basis)
    witness = basis @ (diagonal + error * np.diag(np.arange(len(diagonal)))) @ np.linalg.inv(basis)
    return stability_of(jnp.asarray(matrix), jnp.asarray(witness), jnp.asarray(basis[:, 0]), 1e-3)


@pytest.mark.parametrize(
    ("blocks", "expected"),
    [
        ((0.5, -0.3), Bifurcation.NONE),
        ((1.5, -0.3), Bifurcation.NONE),
        ((1.0005, 0.2), Bifurcation.FOLD),
        ((-0.9995, 0.2), Bifurcation.PERIOD_DOUBLING),
        ((ROTATION, 0.2), Bifurcation.NEIMARK_SACKER),
        ((0.9 * np.array(ROTATION), 0.2), Bifurcation.NONE),
    ],
)
def test_a_multiplier_on_the_unit_circle_is_flagged(blocks, expected):
    assert Bifurcation(int(_stability(*blocks).bifurcation)) == expected


def test_a_multiplier_whose_error_reaches_the_circle_is_flagged():
    assert int(_stability(0.98, 0.2).bifurcation) == Bifurcation.NONE
    assert int(_stability(0.98, 0.2, error=0.03).bifurcation) == Bifurcation.FOLD


def test_the_trivial_multiplier_is_left_out_though_another_is_larger():
    found = _stability(-1.7, 0.4)
    assert np.asarray(found.multipliers) == pytest.approx([-1.7, 0.4])
    assert float(found.spectral_radius) == pytest.approx(1.7)
    assert float(found.unit_error) < 1e-12


def test_an_error_that_vanishes_by_chance_has_its_terms():
    """Changes of a matrix under which no eigenvalue moves, of one on the diagonal, and of a pair
    that meets: eigenvalues part as the root of a change."""

    def errors(matrix, change):
        one, other = (scipy.linalg.block_diag(1.0, each) for each in (matrix, matrix + change))
        along = jnp.asarray([1.0, 0.0, 0.0])
        return np.asarray(stability_of(jnp.asarray(one), jnp.asarray(other), along, 1e-3).errors)

    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    matrix = turn @ np.diag([0.5, -0.2]) @ turn.T
    unseen = turn @ np.array([[0.0, 1e-6], [0.0, 0.0]]) @ turn.T
    assert np.all(errors(matrix, unseen) > 1e-7)
    np.testing.assert_allclose(errors(np.diag([0.5, 0.2]), np.diag([1e-6, 0.0])), [1e-6, 0.0])
    near = errors(np.array([[0.5, 1.0], [0.0, 0.5 + 1e-9]]), np.array([[0.0, 0.0], [1e-8, 0.0]]))
    assert np.all((near >= 0.99e-4) & (near < 1e-3))
