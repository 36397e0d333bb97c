"""Error control: what it makes of an error, by the formula written out, and what it divides by."""

import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np
import pytest

import jaxbiped as jb
from jaxbiped.compiler.passes._operation_counts import count_operations
from jaxbiped.solve._units import units_of
from jaxbiped.solve.controllers._error_control import ErrorControl

RTOL, ATOL = 1e-6, 1e-8
STATE = jb.seed_state()
UNITS = units_of(jb.seed_scene(), STATE)
ORDER = 4


def _adapted(error, dtype=np.float64):
    units = jtu.tree_map(lambda unit: jnp.asarray(unit, dtype), UNITS)
    control = ErrorControl(RTOL, ATOL, units)
    y0, y1, error = (
        jb.State(*(jnp.asarray(x, dtype) for x in each))
        for each in (STATE, [1.1 * float(x) for x in STATE], error)
    )
    zero, rejected = jnp.asarray(0.0, dtype), jnp.asarray(False)
    kept, _, end, *_ = control.adapt_step_size(
        zero, jnp.asarray(1e-3, dtype), y0, y1, None, error, ORDER, rejected
    )
    return bool(kept), float(end)


def _size(error):
    """Root mean square of the error in units of the tolerance."""
    inverse = np.array([float(x) for x in UNITS.inverse])
    largest = 1.1 * np.abs([float(x) for x in STATE])
    return np.sqrt(np.mean((np.asarray(error) / (ATOL / inverse + RTOL * largest)) ** 2))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("wanted", [1e-3, 0.5, 0.9, 1.1, 30.0])
def test_step_size_is_that_of_the_root_mean_square(wanted, dtype):
    direction = np.random.default_rng(3).standard_normal(8) * np.logspace(-3, 2, 8)
    error = direction * wanted / _size(direction)
    kept, end = _adapted(error, dtype)
    assert kept == (wanted < 1.0)
    size = end - 1e-3 if kept else end
    most = 10.0 if kept else 1.0
    expected = 1e-3 * np.clip(0.8 * wanted ** (-1.0 / ORDER), 0.2, most)
    np.testing.assert_allclose(size, expected, rtol=1e-12 if dtype is np.float64 else 1e-3)


@pytest.mark.parametrize("place", range(8))
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_rejected(place, bad):
    error = np.zeros(8)
    error[place] = bad
    assert _adapted(error) == (False, pytest.approx(0.2e-3))


def test_four_tolerances_share_a_division():
    def step(varying, invariant):
        control = ErrorControl(RTOL, ATOL, invariant)
        y0, y1, error = varying
        one = jnp.ones(())
        return control.adapt_step_size(0.0 * one, one, y0, y1, None, error, ORDER, one > 2.0)[2]

    counts = count_operations(step, (STATE, STATE, STATE), UNITS)
    # And one by the root.
    assert counts["fdiv"] == 3
