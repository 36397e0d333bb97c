"""Where a solve's last step ends, against the numbers next to its end."""

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.solve.controllers._solve_ends import just_before_end


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_almost_is_a_hundred_numbers_before(sign):
    ends = sign * np.concatenate([np.geomspace(1e-200, 1e200, 101), [0.0, 1.0, 1.0 + 1e-15, 2.0]])
    expected = jnp.asarray(ends)
    before = jax.jit(eqxi.prevbefore)
    for _ in range(100):
        expected = before(expected)
    np.testing.assert_array_equal(just_before_end(jnp.asarray(ends)), expected)


def test_almost_of_no_number_is_none_and_of_no_end_is_finite():
    assert np.isnan(just_before_end(jnp.asarray(np.nan)))
    assert np.isfinite(just_before_end(jnp.asarray(np.inf)))
