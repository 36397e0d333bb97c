"""Elementary functions over the range of 64-bit numbers, against exact arithmetic in ulps.

Subnormal arguments and results are zero.
"""

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from tests.compiler.one_shot import compiled, evaluate

TINIEST = np.finfo(float).tiny

SPECIAL = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -5e-324, 2.2250738585072014e-308,
           1.7976931348623157e308, -1.7976931348623157e308, 1.0, -1.0]  # fmt: skip
FUNCTIONS = {
    "exp": (jnp.exp, mpmath.exp, 1.0),
    "log": (jnp.log, mpmath.log, 1.0),
    "sin": (jnp.sin, mpmath.sin, 1.0),
    "cos": (jnp.cos, mpmath.cos, 1.0),
    "tanh": (jnp.tanh, mpmath.tanh, 2.0),
    "sqrt": (jnp.sqrt, mpmath.sqrt, 0.5),
}
NEAR = {
    "exp": [-745.2, -708.5, 709.78, 1e-300, 0.34657],
    "log": [1.0 + 2.0**-52, 1.0 - 2.0**-53, 0.70710678, 1.41421356, 1e-310],
    "sin": [np.pi, 2 * np.pi, 1e5 * np.pi, 2.0**20 - 1.0, 1e22, 1e300],
    "cos": [np.pi / 2, 3 * np.pi / 2, 1e5 + 0.5, 2.0**20 + 1.0, 1e22, 1e300],
    "tanh": [0.625, 0.62500001, 19.0, 22.0, 1e-200],
    "sqrt": [2.0, 1e-320],
}


def _points(name):
    rng = np.random.default_rng(0)
    bits = rng.integers(0, 2**64, 1500, dtype=np.uint64).view(np.float64)
    usual = rng.standard_normal(1500) * np.exp(rng.uniform(-30, 6, 1500))
    near = [*NEAR[name], *(-x for x in NEAR[name])]
    points = _flushed(np.concatenate([bits[np.isfinite(bits)], usual, near]))
    return points[points != 0.0]


def _flushed(numbers):
    """Zeros of the same sign for subnormal numbers."""
    numbers = np.asarray(numbers)
    return np.where(np.abs(numbers) < TINIEST, np.copysign(0.0, numbers), numbers)


def _ulps(found, exact):
    """Errors in units in the last place of the exact results."""
    errors = []
    with mpmath.workprec(200):
        for value, truth in zip(found, exact, strict=True):
            if not mpmath.isfinite(truth) or not np.isfinite(float(truth)):
                assert value == float(truth) or np.isnan(float(truth))
                continue
            if abs(truth) < TINIEST:
                assert value == 0.0
                continue
            spacing = float(np.spacing(np.abs(float(truth))))
            errors.append(float(abs(mpmath.mpf(float(value)) - truth)) / spacing)
    return np.array(errors)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_errors_over_the_whole_range(name):
    function, exact, bound = FUNCTIONS[name]
    points = _points(name)
    if name in ("log", "sqrt"):
        points = np.abs(points)
    found = evaluate(function, points)
    with mpmath.workprec(1200):  # sines of large angles
        truth = [exact(mpmath.mpf(float(x))) for x in points]
    assert _ulps(found, truth).max() <= bound + 0.01


def _assert_same(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-15)
    known = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(found)[known], np.signbit(expected)[known])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_special_values_are_the_c_librarys(name):
    function, _, _ = FUNCTIONS[name]
    with np.errstate(all="ignore"):
        expected = _flushed(getattr(np, name)(_flushed(SPECIAL)))
    # What gives the argument itself moves its bits, whatever they are.
    _assert_same(_flushed(evaluate(function, SPECIAL)), expected)


def test_power_over_the_whole_range():
    rng = np.random.default_rng(1)
    x = np.exp(rng.uniform(-700, 700, 3000))
    y = rng.uniform(-1, 1, 3000) * 700.0 / np.maximum(np.abs(np.log(x)), 1e-3)
    found = evaluate(jnp.power, x, y)
    with mpmath.workprec(300):
        truth = [mpmath.power(mpmath.mpf(a), mpmath.mpf(b)) for a, b in zip(x, y, strict=True)]
    assert _ulps(found, truth).max() <= 1.5


def test_special_powers_are_the_c_librarys():
    values = [*SPECIAL, 2.0, -2.0, 3.0, -3.0, 0.5, 1e300, 2.0**53]
    x, y = (grid.ravel() for grid in np.meshgrid(values, values))
    with np.errstate(all="ignore"):
        expected = _flushed(np.power(_flushed(x), _flushed(y)))
    _assert_same(evaluate(jnp.power, x, y), expected)


def test_what_is_hardly_ever_computed_is_marked():
    assert "!prof" in compiled(jnp.log, ()).kernel.text(1)
    assert "!prof" not in compiled(jnp.exp, ()).kernel.text(1)
