"""A trajectory, against both its ends and times beyond them."""

import jax
import numpy as np
import pytest


def test_both_ends_belong_to_it(seed_walk):
    _, walk = seed_walk
    ends = walk.at([0.0, 2.0])
    np.testing.assert_allclose(np.array(ends)[:, 0], [leaf[0] for leaf in walk.state], atol=1e-12)
    np.testing.assert_allclose(np.array(ends)[:, 1], np.array(walk.final), atol=1e-12)


@pytest.mark.parametrize("t", [-0.1, 2.001, float("nan"), [0.5, 2.5], np.nextafter(2.0, 3.0)])
def test_a_time_outside_is_refused_with_the_span(t, seed_walk):
    _, walk = seed_walk
    with pytest.raises(ValueError, match=r"lasts from 0\.0 to 2\.0 s"):
        walk.at(t)


def test_a_traced_time_outside_is_nan(seed_walk):
    _, walk = seed_walk
    inside, outside = jax.jit(lambda t: walk.at(t).theta_1)(np.array([1.0, 2.5]))
    assert np.isfinite(inside)
    assert np.isnan(outside)
