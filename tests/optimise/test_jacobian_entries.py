"""Functionals of a Jacobian, against NumPy's eigenvalues and powers, and against differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.optimise._jacobian_functionals import (
    CLUSTER,
    _eigen,
    _in_pairs,
    entry_weights,
    leading_multipliers,
)
from tests.optimise.drawn_designs import difference

LENGTH = np.array([0.4, 0.9])
SIZES = np.array([1.0, 2.0, 2.0, 5.0, 5.0])
"""Of an angle, of velocities [m/s] and of rates [rad/s] on a walk: the state's last components."""


def block(real, imag):
    return np.array([[real, imag], [-imag, real]])


def with_multipliers(*blocks):
    """A matrix of given eigenvalues, of which those in pairs are blocks."""
    size = sum(np.atleast_2d(each).shape[0] for each in blocks)
    whole, place = np.zeros((size, size)), 0
    for each in map(np.atleast_2d, blocks):
        whole[place : place + len(each), place : place + len(each)] = each
        place += len(each)
    basis = np.eye(size) + 0.3 * np.random.default_rng(7).normal(size=(size, size))
    return basis @ whole @ np.linalg.inv(basis)


def pair_of(real, imag):
    return [real + 1j * imag, real - 1j * imag]


CASES = {
    "real, a pair, and a small one": (
        (0.9, block(0.5, 0.3), 0.2, -0.1, 0.02), [0.9, *pair_of(0.5, 0.3)], 0.2,
    ),
    "a pair that fits in no more": (
        (block(0.8, 0.1), block(0.5, 0.2), 0.1, 0.02), [*pair_of(0.8, 0.1), 0.1], abs(0.5 + 0.2j),
    ),
    "four real ones": ((-0.9, 0.6, 0.5, -0.4, 0.1, 0.02), [-0.9, 0.6, 0.5], 0.4),
}  # fmt: skip


@jax.jit
def told(rows):
    own = rows[-rows.shape[1] :]
    names = (*CLUSTER, "strike_divergence", "modulus_3", "radius_bound")
    leading, length = leading_multipliers(own), jnp.asarray(LENGTH)
    every = {n: entry_weights(n, jb.seed_state(), rows, length, leading) for n in names}
    return {name: tuple(each) for name, each in every.items()}


@pytest.mark.parametrize("name", CASES)
def test_symmetric_functions_moduli_and_divergence(name):
    blocks, cluster, outside = CASES[name]
    own = with_multipliers(*blocks)
    rows = np.concatenate([np.random.default_rng(8).normal(size=(2, 6)), own])
    found = {each: float(value[0]) for each, value in told(rows).items()}
    polynomial = np.poly(cluster).real
    expected = [-polynomial[1], polynomial[2], -polynomial[3]]
    values = np.linalg.eigvals(own)
    sizes = np.sort(np.abs(values[values.imag >= 0.0]))[::-1]
    assert [found[f"symmetric_{k}"] for k in (1, 2, 3)] == pytest.approx(expected)
    assert found["next_modulus"] == pytest.approx(outside)
    assert found["spectral_radius"] == pytest.approx(sizes[0])
    assert found["modulus_3"] == pytest.approx(sizes[2])
    four = np.sort(np.abs(values))[::-1][:4]
    assert found["strike_divergence"] == pytest.approx(np.sum(np.log(four)))
    power = np.linalg.matrix_power(rows[3:, 1:] * SIZES / SIZES[:, None], 64)
    assert found["radius_bound"] == pytest.approx(np.linalg.norm(power) ** (1.0 / 64.0))


@pytest.mark.parametrize("name", CASES)
def test_weights_of_entries_are_differences_and_have_their_rank(name):
    own = with_multipliers(*CASES[name][0])
    rows = np.concatenate([np.random.default_rng(8).normal(size=(2, 6)), own])
    along = np.random.default_rng(9).normal(size=rows.shape)
    first, after, before = told(rows), told(rows + 1e-6 * along), told(rows - 1e-6 * along)
    for each, (_, weights, rank, by_length) in first.items():
        slope = (float(after[each][0]) - float(before[each][0])) / 2e-6
        assert np.sum(weights * along) == pytest.approx(slope, rel=2e-5, abs=1e-8), each
        assert np.linalg.matrix_rank(weights, tol=1e-10) <= int(rank), each
        np.testing.assert_array_equal(by_length, [0.0, 0.0])


@pytest.mark.parametrize("rank", [1, 2, 3, 4, 6])
def test_weights_are_sums_of_products_two_directions_at_a_time(rank):
    random = np.random.default_rng(rank)
    own = min(rank, 4)
    weights = random.normal(size=(6, own)) @ random.normal(size=(own, 4))
    along, scaled = _in_pairs(jnp.asarray(weights), rank)
    assert along.shape == ((rank + 1) // 2, 2, 4)
    assert scaled.shape == ((rank + 1) // 2, 2, 6)
    np.testing.assert_allclose(np.einsum("kci,kcj->ij", scaled, along), weights, atol=1e-12)


def test_what_is_no_number_has_no_multipliers():
    found = _eigen(jnp.asarray([[0.5, np.inf], [0.0, 0.2]]))
    assert np.all(np.isnan(np.abs(found.values)))


NORMS = "sensitivity_norm", "floor_clearance_sensitivity"


@jax.jit
def norms(rows, length):
    return [tuple(entry_weights(name, None, rows, length, None)) for name in NORMS]


def test_a_norm_is_infinite_where_the_gait_is_not_stable():
    for largest, finite in ((0.9, True), (1.01, False)):
        own = with_multipliers(largest, 0.2, 0.1, 0.0)
        for value, weights, *_ in norms(np.concatenate([np.ones((2, 4)), own]), LENGTH):
            assert np.isfinite(float(value)) == finite
            assert np.all(np.isfinite(weights))


def test_a_push_counts_relative_to_step_length_and_period():
    advance = np.random.default_rng(6).normal(size=(2, 4))
    rows = np.concatenate([advance, with_multipliers(0.6, 0.3, 0.1, 0.0)])
    weighted, clearance = norms(rows, LENGTH)
    for k, along in enumerate(np.eye(2)):
        slope = difference(lambda h, along=along: float(norms(rows, LENGTH + h * along)[0][0]))
        assert float(weighted[3][k]) == pytest.approx(slope, rel=1e-6)
    np.testing.assert_array_equal(clearance[3], [0.0, 0.0])
