"""Sparse L U, against dense solves and against the fewest entries that a tree can have."""

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxbiped.linalg._sparse_lu import elimination_order, factorise, product


def _random(seed, rows, missing):
    """A matrix without symmetry whose diagonal outweighs its rows, and all of its entries."""
    random = np.random.default_rng(seed)
    dense = random.normal(size=(len(rows), len(rows)))
    dense[random.random(dense.shape) < missing] = 0.0
    dense += np.diag(np.abs(dense).sum(axis=1) + 1.0)
    places = {
        (i, j): jnp.asarray(dense[a, b])
        for a, i in enumerate(rows)
        for b, j in enumerate(rows)
        if dense[a, b] != 0.0
    }
    return dense, places


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.integers(1, 9), st.sampled_from([0.0, 0.5, 0.8]))
def test_solutions_are_those_of_the_dense_matrix(seed, size, missing):
    rows = [3 * i + 1 for i in range(size)]
    dense, places = _random(seed, rows, missing)
    right = np.random.default_rng(seed + 1).normal(size=size)
    right[::3] = 0.0
    given_ = {i: jnp.asarray(v) for i, v in zip(rows, right, strict=True) if v}
    found = factorise(places).solve(given_)
    solved = [0.0 if found[i] is None else found[i] for i in rows]
    np.testing.assert_allclose(solved, np.linalg.solve(dense, right), rtol=1e-11, atol=1e-13)
    back = product(places, {i: jnp.asarray(v) for i, v in zip(rows, solved, strict=True)})
    np.testing.assert_allclose([back[i] for i in rows], right, rtol=1e-11, atol=1e-12)


def test_a_star_is_eliminated_from_its_leaves_without_new_entries():
    """Rows 0 and 1 are joined with all others, which do not touch each other."""
    rows = tuple(range(8))
    places = {(i, j) for i in (0, 1) for j in rows} | {(i, i) for i in rows}
    assert elimination_order(rows, places) == (7, 6, 5, 4, 3, 2, 1, 0)
    matrix = {place: jnp.asarray(4.0 if place[0] == place[1] else 0.3) for place in places}
    matrix |= {(j, i): entry for (i, j), entry in matrix.items()}
    factors = factorise(matrix)
    assert set(factors.entries) == {place for place in matrix if place[0] != place[1]}


def test_what_a_zero_right_side_gives_is_not_computed():
    _, places = _random(0, [0, 1], 0.0)
    apart = {**places, (2, 2): jnp.asarray(2.0)}
    found = factorise(apart).solve({2: jnp.asarray(3.0)})
    assert [found[0], found[1], float(found[2])] == [None, None, 1.5]


def test_factors_pass_through_transformations():
    _, places = _random(1, [0, 1, 2], 0.0)
    factors = jax.jit(factorise)(places)
    assert factors.order == factorise(places).order
