"""Sine and cosine: against 80-bit arithmetic, with derivatives and at the edges."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped._trigonometry import sine_cosine

ERROR = 2.3e-16


def _angles():
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], 100_000)
    spread = signs * 10.0 ** rng.uniform(-12.0, 5.0, signs.size)
    multiples = np.arange(-60_000, 60_001, 7) * (np.pi / 4.0)
    near = np.concatenate([multiples, np.nextafter(multiples, 9e9), np.nextafter(multiples, -9e9)])
    return np.concatenate([spread, rng.uniform(-1e5, 1e5, 50_000), near, [0.0, 1e5, -1e5]])


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="long double is no wider")
def test_errors_stay_below_the_claim():
    angles = _angles()
    assert np.abs(angles).max() == 1e5
    sine, cosine = jax.jit(sine_cosine)(jnp.asarray(angles))
    wide = angles.astype(np.longdouble)
    assert np.abs(np.asarray(sine).astype(np.longdouble) - np.sin(wide)).max() < ERROR
    assert np.abs(np.asarray(cosine).astype(np.longdouble) - np.cos(wide)).max() < ERROR


def test_small_sines_keep_their_relative_accuracy():
    angles = 10.0 ** np.linspace(-300.0, -1.0, 1000)
    sine = np.asarray(sine_cosine(jnp.asarray(angles))[0])
    assert np.abs(sine / np.sin(angles) - 1.0).max() < 5e-16


@pytest.mark.parametrize("dtype", [jnp.float64, jnp.float32])
def test_what_is_not_finite_has_no_sine(dtype):
    angles = jnp.array([jnp.inf, -jnp.inf, jnp.nan], dtype=dtype)
    for values in sine_cosine(angles):
        assert np.isnan(np.asarray(values)).all()


def test_zero_and_symmetry():
    assert sine_cosine(jnp.asarray(0.0)) == (0.0, 1.0)
    angles = jnp.linspace(0.1, 40.0, 1001)
    (sine, cosine), (mirrored_sine, mirrored_cosine) = sine_cosine(angles), sine_cosine(-angles)
    assert np.array_equal(mirrored_sine, -sine)
    assert np.array_equal(mirrored_cosine, cosine)


def test_derivatives_are_the_functions_themselves():
    angles = jnp.linspace(-7.0, 7.0, 101)
    sine, cosine = sine_cosine(angles)
    primal, tangent = jax.jvp(sine_cosine, (angles,), (jnp.full_like(angles, 3.0),))
    assert np.array_equal(primal[0], sine)
    assert np.array_equal(tangent[0], 3.0 * cosine)
    assert np.array_equal(tangent[1], -3.0 * sine)
    second = jax.vmap(jax.grad(jax.grad(lambda angle: sine_cosine(angle)[0])))(angles)
    assert np.array_equal(second, -sine)


def test_32_bits_stay_32_bits():
    angles = jnp.linspace(-10.0, 10.0, 501, dtype=jnp.float32)
    sine, cosine = sine_cosine(angles)
    assert sine.dtype == cosine.dtype == jnp.float32
    assert (
        np.abs(np.asarray(sine, np.float64) - np.sin(np.asarray(angles, np.float64))).max() < 1e-7
    )
    assert np.abs(np.asarray(cosine) - np.cos(np.asarray(angles, np.float64))).max() < 1e-7
